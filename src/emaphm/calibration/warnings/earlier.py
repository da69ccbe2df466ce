"""What a calibration of a unit that was calibrated before contradicts, and what of that one is lost."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.actuator.unit.baseline import SIGNED, Baseline
from emaphm.actuator.unit.model_error import NOT_LEARNED
from emaphm.arrays import Array

CONTRADICTS = 5.0
"""Standard errors of the difference: two calibrations of one unit by other recordings differ by less."""


def earlier_warnings(before: Actuator, after: Actuator) -> tuple[str, ...]:
    """Return sentences on what the calibrated description `after` makes of the one it began with, `before`.

    None where that was not calibrated, or by the same recordings.
    """
    old, new = before.baseline, after.baseline
    if old is None or new is None:
        return ()
    again = {Path(one).name for one in new.recordings}
    lost = [one for one in old.recordings if Path(one).name not in again]
    return (*_contradictions(before, after, old, new), *_lost(lost, before, after)) if lost else ()


def _contradictions(before: Actuator, after: Actuator, old: Baseline, new: Baseline) -> Sequence[str]:
    names = tuple(name for name in old.names if name in new.names)
    sizes = np.abs(_differences(before, after, names)) / _errors(old, new, names)
    far = [f"{name} by {size:.0f}" for name, size in zip(names, sizes, strict=True) if size > CONTRADICTS]
    if not far:
        return ()
    sentence = (
        f"this calibration contradicts the one before, by {', '.join(old.recordings)}, in standard errors of "
        f"the difference: {', '.join(far)}; if it is of the same unit, that has changed, a law is missing, "
        "or a recording or what is known of it is wrong"
    )
    return (sentence,)


def _differences(before: Actuator, after: Actuator, names: tuple[str, ...]) -> Array:
    """Return by how much the parameters `names` differ (names,), in the units of a baseline's covariance."""
    first, second = lumped_parameters(before, names), lumped_parameters(after, names)
    return np.array(
        [
            second[name] - first[name] if name in SIGNED else np.log(second[name] / first[name])
            for name in names
        ]
    )


def _errors(old: Baseline, new: Baseline, names: tuple[str, ...]) -> Array:
    squares = [old.deviations[name] ** 2 + new.deviations[name] ** 2 for name in names]
    return np.sqrt(np.maximum(squares, np.finfo(float).tiny))


def _lost(recordings: Sequence[str], before: Actuator, after: Actuator) -> Sequence[str]:
    model_error = before.model_error != NOT_LEARNED and after.model_error == NOT_LEARNED
    what = "what they say of the parameters" + (" and of the model error" if model_error else "")
    sentence = (
        f"this calibration takes the place of the one before, by {', '.join(recordings)}: {what} is no "
        "longer in the description; to keep it, calibrate with these recordings too"
    )
    return (sentence,)
