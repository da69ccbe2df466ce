"""Whether an actuator moved."""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective

LEAST_MOTION = 0.01
"""Smallest range of the position of a moving actuator, relative to the command's range."""

LEAST_WHITENESS, FOLLOWS = 0.6, 0.5
"""Smallest ratio of von Neumann of white noise in few rows, and correlation of a motion with its command.
Slow rows of a fast motion have an equally large ratio: 0.5 for a chirp up to 3 Hz in rows at 10 Hz."""


def moves_at(objective: MapObjective, point: Array) -> bool:
    """Return whether the actuator moved: by the recorded position, or else by the model at `point` (d,)."""
    measured, name = objective.problem.measured, "position_rad"
    position = measured[name] if name in measured else modelled_position(objective, point)
    command = measured["command_rad"]
    return bool(np.ptp(position) > LEAST_MOTION * np.ptp(command)) and not _is_noise(position, command)


def _is_noise(position: Array, command: Array) -> bool:
    """Return whether a `position` (samples,) is white noise and does not follow the `command`.

    In white noise, rows differ from their neighbours as much as from all other rows (von Neumann 1941).
    """
    centred, centred_command = position - position.mean(), command - command.mean()
    ratio = np.mean(np.diff(centred) ** 2) / max(2 * np.mean(centred**2), np.finfo(float).tiny)
    follows = abs(centred @ centred_command) > FOLLOWS * float(
        np.linalg.norm(centred) * np.linalg.norm(centred_command)
    )
    return bool(ratio > max(LEAST_WHITENESS, 1 - 4 / position.size**0.5)) and not follows


def modelled_position(objective: MapObjective, point: Array) -> Array:
    """Return the user's position by the model at `point` (d,), (samples,)."""
    observing = replace(objective, problem=objective.problem.observing(("position_rad",)))
    return np.asarray(observing.outputs(point[np.newaxis])[0, : objective.problem.samples])
