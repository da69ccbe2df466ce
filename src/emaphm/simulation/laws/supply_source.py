"""A supply whose voltage sags under current."""

from typing import Any

from emaphm.simulation.laws.select import clip

LOWEST = 0.02
"""Least share of the open-circuit voltage that is left under current."""

HIGHEST = 2.0
"""Largest multiple of it that current fed back raises the voltage to: beyond, a drive's chopper burns it."""


def sagging_supply(open_circuit: Any, resistance: Any, current: Any) -> Any:
    """Return the voltage of a supply with a source resistance.

        V_dc = clip(V_0 - R_0 i_dc, V_0 / 50, 2 V_0)

    Parameters
    ----------
    open_circuit : V_0, voltage without current [V]
    resistance : R_0 ≥ 0, of source and leads [ohm]
    current : i_dc, that the inverter draws; negative where it feeds back [A]

    Returns
    -------
    V_dc at the inverter [V].

    Notes
    -----
    The current is that of the step before: explicit, stable where R_0 is below the resistance of the winding.
    """
    return clip(open_circuit - resistance * current, LOWEST * open_circuit, HIGHEST * open_circuit)


def supply_under_duty(
    open_circuit: Any, resistance: Any, duty: Any, current: Any, back_emf: Any, conductance: Any, decay: Any
) -> Any:
    """Return the voltage of a supply with a source resistance that feeds one winding through a duty cycle.

    The winding's current after the step, i⁺ = i d + (1 - d)(D V_dc - e) / R, is drawn as i_dc = D i⁺, so that

        V_dc = (V_0 - R_0 D (i d - (1 - d) e / R)) / (1 + D² (1 - d) R_0 / R)

    Parameters
    ----------
    open_circuit, resistance : V_0 [V], R_0 ≥ 0 [ohm]
    duty : D, in [-1, 1] [-]
    current, back_emf : i before the step [A], e [V]
    conductance, decay : 1 / R of the winding [S], d = exp(-R Δt / L) [-]

    Returns
    -------
    V_dc at the inverter [V].

    Notes
    -----
    Implicit in the current, so stable for any source resistance.
    """
    built = (1.0 - decay) * conductance
    without = open_circuit - resistance * duty * (current * decay - built * back_emf)
    return without / (1.0 + duty * duty * built * resistance)
