"""Hysteresis switching of one inverter leg."""

from typing import Any

from emaphm.simulation.laws.select import select


def switch(state: Any, error: Any, band: Any) -> Any:
    """Return the state of a leg after its comparator has seen the current error.

        s⁺ = +1   (i_dem - i > hb)
        s⁺ = -1   (i_dem - i < -hb)
        s⁺ = s    elsewhere

    The leg's voltage is s V_dc / 2.

    Parameters
    ----------
    state : s, before: +1 high, -1 low [-]
    error : i_dem - i, demanded less actual phase current [A]
    band : hb > 0, at which the comparator switches, on either side of 0 [A]

    Returns
    -------
    s⁺, +1 or -1 [-].

    Notes
    -----
    No dead time, no voltage drop. The switching frequency follows from hb, inductance and supply.

    References
    ----------
    [1] Thesis, section 3.1.3, Fig. 3.6 and 3.7.
    """
    return select(error > band, 1.0, select(error < -band, -1.0, state))
