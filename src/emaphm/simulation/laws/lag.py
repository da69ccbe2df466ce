"""First-order lags of a drive: of its speed feedback, and from current to torque."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.simulation.laws.inline import law


def share_of_step(lag: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Return what share of the way to its input a first-order `lag` [s] goes in `step` [s]; 1 without lag."""
    return np.asarray(-np.expm1(-step / np.maximum(lag, 1e-6 * step)))


@law
def approach(before: Any, target: Any, share: Any) -> Any:
    """Return a lagging value after a step: it was `before` and goes `share` of the way to `target`."""
    return (1.0 - share) * before + share * target
