"""Constant channels: channels that are not compared, and sensors without signal while the actuator moves."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from emaphm.estimation.compared_channels import comparable_channels
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult


def idle_channels(problem: Problem) -> tuple[str, ...]:
    """Return a note on each recorded channel that is not compared because it is constant."""
    return tuple(
        f"{name} is {problem.measured[name][0]:.3g} throughout and is not compared; check its sensor, or "
        "leave the column out"
        for name in comparable_channels(problem.actuator, problem.model)
        if name in problem.measured and name not in problem.channels and np.ptp(problem.measured[name]) == 0
    )


def standing_sensors(result: SearchResult) -> Iterator[str]:
    """Yield a sentence on each sensor of current or motion that is constant while the model moves."""
    problem = result.objective.problem
    if np.ptp(problem.recorded) == 0:
        yield (
            f"{problem.primary} shows {problem.recorded[0]:.3g} throughout, while the actuator moves; "
            "check its sensor and its line"
        )
    still = tuple(
        name
        for name in ("position_rad", "speed_rad_s")
        if name in problem.measured and np.ptp(problem.measured[name]) == 0
    )
    if not still or not set(still) <= set(comparable_channels(problem.actuator, problem.model)):
        return
    observing = replace(result.objective, problem=problem.observing(still))
    modelled = observing.outputs(result.point[np.newaxis])[0, : observing.channel_rows]
    for name, values in zip(still, modelled.reshape(len(still), -1), strict=True):
        if np.any(problem.measured[name]) and np.ptp(values) > 0:
            yield (
                f"{name} shows {problem.measured[name][0]:.3g} throughout, while the current indicates that "
                "the actuator moves; it is jammed, or the sensor is frozen"
            )
