"""A load that steps: what comes on at an instant of the run, at once or over a rise time."""

from typing import Any

import numpy as np

from emaphm.simulation.laws.select import clip

STEP_PREFIX = "load_step_"
"""What the names of a step's size, time and rise begin with; its number follows, from 1 on."""

STEP_PARTS = ("", "_time", "_rise")
"""Endings of the names of what a step has: its size, its time, its rise time."""


def step_names(number: int) -> tuple[str, str, str]:
    """Return the names of the size [N·m], the time [s] and the rise time [s] of a load's step, from 1 on."""
    size, time, rise = (f"{STEP_PREFIX}{number}{part}" for part in STEP_PARTS)
    return size, time, rise


def step_load(size: Any, instant: Any, rise: Any, time: Any, interval: Any) -> Any:
    """Return the load of a step, a ramp about its instant.

        T_s · min(max((t - t_s) / max(t_r, Δt) + 1/2, 0), 1)

    No ramp is shorter than an interval: what a model shows then changes with the instant, and not by whole
    intervals.

    Parameters
    ----------
    size : T_s, what comes on [N·m]
    instant : t_s, when half of it has [s]
    rise : t_r, how long it takes [s]
    time : t, at the middle of an interval [s]
    interval : Δt, of an integration step, or of a row [s]
    """
    return size * clip((time - instant) / np.maximum(rise, interval) + 0.5, 0.0, 1.0)
