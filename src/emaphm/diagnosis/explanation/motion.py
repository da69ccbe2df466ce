"""Whether an actuator moved."""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective

LEAST_MOTION = 0.01
"""Share of the command's range that the position covers at least where a manoeuvre moves the actuator."""

LEAST_WHITENESS, FOLLOWS = 0.6, 0.5
"""Von Neumann's ratio of white noise in few rows at least, and the correlation of a motion with its command.
In slow rows of a fast motion the ratio is as large: 0.5 of a chirp up to 3 Hz in rows at 10 Hz."""


def moves_at(objective: MapObjective, point: Array) -> bool:
    """Return whether the actuator moved: by its recorded position, or else by the model's at `point` (d,)."""
    measured, name = objective.problem.measured, "position_rad"
    position = measured[name] if name in measured else modelled_position(objective, point)
    command = measured["command_rad"]
    return bool(np.ptp(position) > LEAST_MOTION * np.ptp(command)) and not _is_noise(position, command)


def _is_noise(position: Array, command: Array) -> bool:
    """Return whether a `position` (samples,) is no more than white noise, and does not follow the `command`.

    Its rows then differ from their neighbours as they do from all others (the ratio of von Neumann 1941).
    """
    off, asked = position - position.mean(), command - command.mean()
    ratio = np.mean(np.diff(off) ** 2) / max(2 * np.mean(off**2), np.finfo(float).tiny)
    follows = abs(off @ asked) > FOLLOWS * float(np.linalg.norm(off) * np.linalg.norm(asked))
    return bool(ratio > max(LEAST_WHITENESS, 1 - 4 / position.size**0.5)) and not follows


def modelled_position(objective: MapObjective, point: Array) -> Array:
    """Return the user's position by the model at `point` (d,), (samples,)."""
    observing = replace(objective, problem=objective.problem.observing(("position_rad",)))
    return np.asarray(observing.outputs(point[np.newaxis])[0, : objective.problem.samples])
