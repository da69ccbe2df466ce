"""Hysteresis switching of one inverter leg (thesis 3.1.3, Fig. 3.6)."""

from typing import Any

from emaphm.simulation.laws.inline import law, select


@law
def switch(state: Any, error: Any, band: Any) -> Any:
    """Return the leg's state, +1 high or -1 low.

    High where the current error [A] exceeds `band` [A], low where it is below -`band`, else as before.
    """
    return select(error > band, 1.0, select(error < -band, -1.0, state))
