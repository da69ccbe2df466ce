"""An inverter leg whose switches are both off: its diodes alone conduct."""

from typing import Any

from emaphm.simulation.laws.inline import clip, law, select


@law
def diode_voltage(current: Any, open_voltage: Any, half_supply: Any) -> Any:
    """Return the voltage of a leg whose switches are off.

        v = -V_dc/2   (i > 0: the lower diode carries a current out of the leg)
        v = +V_dc/2   (i < 0: the upper diode)
        v = clip(v_o, -V_dc/2, V_dc/2)   (i = 0: both block, unless the winding drives a current through one)

    Parameters
    ----------
    current : i, from the leg into its winding [A]
    open_voltage : v_o, of the terminal while no current flows: centre of the star plus back-EMF [V]
    half_supply : V_dc / 2 [V]

    Returns
    -------
    v [V].

    Notes
    -----
    Ideal diodes. At v = v_o the winding's current stays 0.
    """
    floating = clip(open_voltage, -half_supply, half_supply)
    return select(current > 0.0, -half_supply, select(current < 0.0, half_supply, floating))


@law
def blocked(before: Any, after: Any) -> Any:
    """Return the current of a leg whose switches are off after a step: a diode ends it at 0.

        i⁺ = 0 where i i' < 0, else i'

    Parameters
    ----------
    before, after : i, and i' as the windings alone would have it [A]

    Returns
    -------
    i⁺ [A].
    """
    return select(before * after < 0.0, 0.0, after)
