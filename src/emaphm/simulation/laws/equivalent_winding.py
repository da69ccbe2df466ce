"""One equivalent winding: the two conducting phases in series (monitor and averaged model)."""

from typing import Any


def winding_current(current: Any, voltage: Any, conductance: Any, decay: Any) -> Any:
    """Return the current in a winding after a step under constant voltage.

    The exact solution of L di/dt = v - R i over one step:

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
    Stable for any step, exact as long as the voltage is constant in it. With decay = 0 the winding has no
    inductance.

    References
    ----------
    [1] Thesis, section 3.2.2: (1/R) / (τ s + 1), τ = L / R.
    """
    final = voltage * conductance
    return final + (current - final) * decay


def mean_voltage(before: Any, after: Any, back_emf: Any, conductance: Any, decay: Any) -> Any:
    """Return the constant voltage that takes a winding from one current to another in a step.

    `winding_current` solved for the terminal voltage:

        u = e + (i⁺ - i exp(-R Δt / L)) R / (1 - exp(-R Δt / L))

    Parameters
    ----------
    before, after : i and i⁺, at both ends of the step [A]
    back_emf : e [V]
    conductance : 1 / R [S]
    decay : exp(-R Δt / L), in [0, 1) [-]

    Returns
    -------
    u, terminal voltage [V].
    """
    return back_emf + (after - decay * before) / ((1.0 - decay) * conductance)
