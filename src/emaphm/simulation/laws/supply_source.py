"""A supply whose voltage sags under current."""

from typing import Any

from emaphm.simulation.laws.inline import law


@law
def sagging_supply(open_circuit: Any, resistance: Any, current: Any) -> Any:
    """Return the voltage of a supply with a source resistance.

        V_dc = V_0 - R_0 i_dc

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
    return open_circuit - resistance * current
