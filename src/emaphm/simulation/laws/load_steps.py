"""Step of the load during a run, sudden or with a rise time."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip

STEP_PREFIX = "load_step_"
"""Prefix of the names of a step's size, time and rise time; the number of the step follows, from 1."""

STEP_PARTS = ("", "_time", "_rise")
"""Suffixes of the names of a step's size, time and rise time."""


def step_names(number: int) -> tuple[str, str, str]:
    """Return the names of size [N·m], time [s] and rise time [s] of the load step `number`, from 1."""
    size, time, rise = (f"{STEP_PREFIX}{number}{part}" for part in STEP_PARTS)
    return size, time, rise


def step_load(size: Any, instant: Any, rise: Any, time: Any, interval: Any) -> Any:
    """Return the load of a step: a ramp centred on its instant.

        T_s · min(max((t - t_s) / max(t_r, Δt) + 1/2, 0), 1)

    The ramp takes at least one interval, so that the output of a model is a continuous function of t_s.

    Parameters
    ----------
    size : T_s, height of the step [N·m]
    instant : t_s, time at which the load is T_s / 2 [s]
    rise : t_r ≥ 0, rise time from 0 to T_s [s]
    time : t, middle of an interval [s]
    interval : Δt, duration of an integration step, or of a row [s]

    Returns
    -------
    Load at t, to be added to the external load [N·m].
    """
    return size * clip((time - instant) / np.maximum(rise, interval) + 0.5, 0.0, 1.0)
