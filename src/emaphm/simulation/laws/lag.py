"""First-order lags of a drive: of its speed feedback, and from current to torque."""

from typing import Any

import numpy as np

from emaphm.arrays import Array


def share_of_step(lag: Array, step: float) -> Array:
    """Return what share of the way to its input a first-order lag goes in one step.

        a = 1 - exp(-Δt / T)

    Parameters
    ----------
    lag : T ≥ 0, time constants, shape (n,) [s]
    step : Δt [s]

    Returns
    -------
    a, in (0, 1], shape (n,) [-]; 1 without lag.
    """
    return np.asarray(-np.expm1(-step / np.maximum(lag, 1e-6 * step)))


def approach(before: Any, target: Any, share: Any) -> Any:
    """Return a lagging value after a step: the exact solution of T dy/dt = x - y with constant x.

        y⁺ = (1 - a) y + a x,   a = 1 - exp(-Δt / T)

    Parameters
    ----------
    before : y, before the step, in the unit of x
    target : x, what it follows
    share : a, of `share_of_step`, in (0, 1] [-]

    Returns
    -------
    y⁺, after the step, in the unit of x.

    Notes
    -----
    Not in the thesis. The drive of a real machine (`examples/emps`) needs it.
    """
    return (1.0 - share) * before + share * target
