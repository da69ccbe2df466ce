"""Supply with a source resistance: its voltage falls with the current."""

from typing import Any

from emaphm.simulation.laws.select import clip

LOWEST = 0.02
"""Least voltage under current, relative to the open-circuit voltage [-]."""

HIGHEST = 2.0
"""Largest voltage under regenerated current, relative to the open-circuit voltage [-]: the drive's brake
chopper limits it."""


def sagging_supply(open_circuit: Any, resistance: Any, current: Any) -> Any:
    """Return the voltage of a supply with a source resistance.

        V_dc = clip(V_0 - R_0 i_dc, V_0 / 50, 2 V_0)

    Parameters
    ----------
    open_circuit : V_0, open-circuit voltage [V]
    resistance : R_0 ≥ 0, resistance of source and leads [ohm]
    current : i_dc, current that the inverter draws; negative if it regenerates [A]

    Returns
    -------
    V_dc, voltage at the inverter [V].

    Notes
    -----
    The current is that of the previous step: explicit, stable if R_0 is below the resistance of the winding.
    """
    return clip(open_circuit - resistance * current, LOWEST * open_circuit, HIGHEST * open_circuit)


def supply_under_duty(
    open_circuit: Any, resistance: Any, duty: Any, current: Any, back_emf: Any, conductance: Any, decay: Any
) -> Any:
    """Return the voltage of a supply with a source resistance that feeds one winding with a duty cycle.

    The current of the winding after the step is i⁺ = i d + (1 - d)(D V_dc - e) / R, and the supply current is
    i_dc = D i⁺. With V_dc = V_0 - R_0 i_dc,

        V_dc = (V_0 - R_0 D (i d - (1 - d) e / R)) / (1 + D² (1 - d) R_0 / R)

    Parameters
    ----------
    open_circuit, resistance : V_0, open-circuit voltage [V]; R_0 ≥ 0, source resistance [ohm]
    duty : D, duty cycle, in [-1, 1] [-]
    current, back_emf : i, current before the step [A]; e, back-EMF [V]
    conductance, decay : 1 / R of the winding [S]; d = exp(-R Δt / L) [-]

    Returns
    -------
    V_dc, voltage at the inverter [V].

    Notes
    -----
    Implicit in the current, therefore stable for any source resistance.
    """
    response = (1.0 - decay) * conductance
    unloaded_effect = open_circuit - resistance * duty * (current * decay - response * back_emf)
    return unloaded_effect / (1.0 + duty * duty * response * resistance)
