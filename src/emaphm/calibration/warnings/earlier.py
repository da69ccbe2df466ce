"""Warnings on an earlier calibration of the unit: contradictions to it, and lost information."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.actuator.unit.baseline import SIGNED, Baseline
from emaphm.actuator.unit.model_error import NOT_LEARNED
from emaphm.arrays import Array

CONTRADICTS = 5.0
"""Limit of a difference, in its standard errors; calibrations of one unit by other recordings are below."""


def earlier_warnings(before: Actuator, after: Actuator) -> tuple[str, ...]:
    """Return sentences on differences of the calibrated description `after` from the calibration `before`.

    Empty if `before` was not calibrated, or was calibrated with recordings that are used again.
    """
    old, new = before.baseline, after.baseline
    if old is None or new is None:
        return ()
    again = {Path(source).name for source in new.recordings}
    lost = [source for source in old.recordings if Path(source).name not in again]
    return (
        (*_contradictions(before, after, old, new), *_lost_information(lost, before, after)) if lost else ()
    )


def _contradictions(before: Actuator, after: Actuator, old: Baseline, new: Baseline) -> Sequence[str]:
    names = tuple(name for name in old.names if name in new.names)
    sizes = np.abs(_differences(before, after, names)) / _standard_errors(old, new, names)
    far = [f"{name} by {size:.0f}" for name, size in zip(names, sizes, strict=True) if size > CONTRADICTS]
    if not far:
        return ()
    sentence = (
        f"this calibration contradicts the one before, by {', '.join(old.recordings)}, in standard errors of "
        f"the difference: {', '.join(far)}; if both are of the same unit, the unit has changed, a law is "
        "missing, or a recording or its known values are wrong"
    )
    return (sentence,)


def _differences(before: Actuator, after: Actuator, names: tuple[str, ...]) -> Array:
    """Return the differences of the parameters `names`, (names,), in the units of a baseline's covariance."""
    first, second = lumped_parameters(before, names), lumped_parameters(after, names)
    return np.array(
        [
            second[name] - first[name] if name in SIGNED else np.log(second[name] / first[name])
            for name in names
        ]
    )


def _standard_errors(old: Baseline, new: Baseline, names: tuple[str, ...]) -> Array:
    squares = [old.deviations[name] ** 2 + new.deviations[name] ** 2 for name in names]
    return np.sqrt(np.maximum(squares, np.finfo(float).tiny))


def _lost_information(recordings: Sequence[str], before: Actuator, after: Actuator) -> Sequence[str]:
    model_error = before.model_error != NOT_LEARNED and after.model_error == NOT_LEARNED
    subject = "the parameters" + (" and the model error" if model_error else "")
    sentence = (
        f"this calibration takes the place of the one before, by {', '.join(recordings)}: their information "
        f"on {subject} is no longer in the description; to keep it, calibrate with these recordings as well"
    )
    return (sentence,)
