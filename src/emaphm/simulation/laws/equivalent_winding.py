"""Equivalent winding: the two conducting phases in series (monitor model, averaged model)."""

from typing import Any


def winding_current(current: Any, voltage: Any, conductance: Any, decay: Any) -> Any:
    """Return the current in a winding after a step under constant voltage.

    This is the exact solution of L di/dt = v - R i over one step:

        i⁺ = v/R + (i - v/R) exp(-R Δt / L)

    Parameters
    ----------
    current : i, before the step [A]
    voltage : v, terminal voltage less back-EMF, constant over the step [V]
    conductance : 1 / R [S]
    decay : exp(-R Δt / L), in [0, 1) [-]

    Returns
    -------
    i⁺, current after the step [A].

    Notes
    -----
    Stable for any step; exact if the voltage is constant during the step. decay = 0 is a winding without
    inductance.

    References
    ----------
    [1] Thesis, section 3.2.2: (1/R) / (τ s + 1), τ = L / R.
    """
    final = voltage * conductance
    return final + (current - final) * decay


def mean_voltage(before: Any, after: Any, back_emf: Any, conductance: Any, decay: Any) -> Any:
    """Return the constant voltage that changes the current of a winding from i to i⁺ in one step.

    This is the equation of `winding_current`, solved for the terminal voltage:

        u = e + (i⁺ - i exp(-R Δt / L)) R / (1 - exp(-R Δt / L))

    Parameters
    ----------
    before, after : i, i⁺, currents at the start and at the end of the step [A]
    back_emf : e [V]
    conductance : 1 / R [S]
    decay : exp(-R Δt / L), in [0, 1) [-]

    Returns
    -------
    u, terminal voltage [V].
    """
    return back_emf + (after - decay * before) / ((1.0 - decay) * conductance)
