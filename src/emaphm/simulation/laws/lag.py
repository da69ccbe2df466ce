"""First-order lags of a drive: of feedback, command and sensors, and from current to torque."""

from typing import Any

import numpy as np

from emaphm.arrays import Array


def share_of_step(lag: Array, step: float) -> Array:
    """Return the fraction of the distance to its input that a first-order lag covers in one step.

        a = 1 - exp(-Δt / T)

    Parameters
    ----------
    lag : T ≥ 0, time constants, shape (n,) [s]
    step : Δt [s]

    Returns
    -------
    a, in (0, 1], shape (n,) [-]; 1 without a lag.
    """
    return np.asarray(-np.expm1(-step / np.maximum(lag, 1e-6 * step)))


def approach(before: Any, target: Any, share: Any) -> Any:
    """Return the output of a first-order lag after a step: the exact solution of T dy/dt = x - y, x constant.

        y⁺ = (1 - a) y + a x,   a = 1 - exp(-Δt / T)

    Parameters
    ----------
    before : y, output before the step, in the unit of x
    target : x, input
    share : a, from `share_of_step`, in (0, 1] [-]

    Returns
    -------
    y⁺, output after the step, in the unit of x.

    Notes
    -----
    Not in the thesis. The drive of a real machine (`examples/emps`) requires it.
    """
    return (1.0 - share) * before + share * target
