"""Hysteresis switching of one inverter leg."""

from typing import Any

from emaphm.simulation.laws.select import select


def switch(state: Any, error: Any, band: Any) -> Any:
    """Return the state of a leg after its comparator has evaluated the current error.

        s⁺ = +1   (i_dem - i > hb)
        s⁺ = -1   (i_dem - i < -hb)
        s⁺ = s    (otherwise)

    The leg's voltage is s V_dc / 2.

    Parameters
    ----------
    state : s, state before: +1 high, -1 low [-]
    error : i_dem - i, reference current less actual current of the phase [A]
    band : hb ≥ 0, magnitude of the error at which the comparator switches [A]

    Returns
    -------
    s⁺, +1 or -1 [-].

    Notes
    -----
    No dead time, no voltage drop. hb, the inductance and the supply determine the switching frequency.

    References
    ----------
    [1] Thesis, section 3.1.3, Fig. 3.6 and 3.7.
    """
    return select(error > band, 1.0, select(error < -band, -1.0, state))
