"""The proof of a plan: its test is simulated under faults that chose nothing, and diagnosed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.diagnose import diagnose
from emaphm.diagnosis.error_metric import error_percent
from emaphm.estimation.bias_correction import RESOLUTION
from emaphm.estimation.parameter_space import FaultSpace
from emaphm.experiment.excitation import Manoeuvre
from emaphm.experiment.predicted_precision import Widths
from emaphm.experiment.test_setup import Conditions
from emaphm.progress import Progress, subprogress

CHANCE = 2.0
"""Standard errors that an improvement must exceed to be none of chance."""


@dataclass(frozen=True, eq=False)
class Proven:
    """What diagnoses of simulated tests made of a manoeuvre: interval `widths`, `errors` [%] (tests,).

    `logarithms`, (tests,), are the means over the faults' coordinates of the logarithm of the error, as
    those of the `widths` are: an error in percent is that of what is known least, and tells nothing of the
    others.
    """

    widths: Widths
    errors: Array
    logarithms: Array

    @property
    def median_error(self) -> float:
        """The median error [%], as `emaphm.error_percent`."""
        return float(np.median(self.errors))


@dataclass(frozen=True)
class Gain:
    """How much one manoeuvre does better than another on the same faults, and its standard error.

    `narrower` is the mean difference of the logarithms of the half-widths, `nearer` that of the errors';
    above 0 where the intervals are narrower, or the estimates nearer to the truth.
    """

    narrower: float
    narrower_error: float
    nearer: float
    nearer_error: float

    @classmethod
    def of(cls, before: Proven, after: Proven) -> "Gain":
        """Return what `after` gains on `before`, fault vector by fault vector."""
        narrower = before.widths.logarithms - after.widths.logarithms
        return cls(*_mean_and_error(narrower), *_mean_and_error(before.logarithms - after.logarithms))

    @property
    def real(self) -> bool:
        """Whether the intervals are narrower by more than chance, and the errors no larger by more."""
        return self.narrower > CHANCE * self.narrower_error and self.nearer >= -CHANCE * self.nearer_error


def prove(
    conditions: Conditions,
    manoeuvres: Sequence[Manoeuvre],
    tests: int,
    seed: int,
    on_progress: Progress | None = None,
) -> list[Proven]:
    """Return what `tests` simulated tests make of each of `manoeuvres`, all under the same faults."""
    faults = conditions.faults(tests, seed)
    space = FaultSpace.of(conditions.actuator)
    shown = np.array([i in space.columns for i in range(faults.shape[1])])
    # What the actuator cannot show is no error of a diagnosis.
    truths = np.where(shown, faults, conditions.faults(1, seed))
    result = []
    for turn, manoeuvre in enumerate(manoeuvres):
        mine = subprogress(on_progress, turn / len(manoeuvres), (turn + 1) / len(manoeuvres))
        fitted = conditions.fit(manoeuvre).space
        diagnoses = []
        for i, recording in enumerate(conditions.record(manoeuvre, truths, seed)):
            diagnoses.append(
                diagnose(
                    recording,
                    conditions.actuator,
                    nuisances=fitted.nuisances.chosen,
                    seed=seed,
                    workers=conditions.workers,
                )
            )
            if mine is not None:
                mine((i + 1) / tests)
        found = np.array([diagnosis.faults.vector for diagnosis in diagnoses])
        covariances = np.array([diagnosis.covariance for diagnosis in diagnoses])
        points = fitted.points(found)
        misses = np.abs(points - fitted.points(truths))[:, : len(fitted.columns)]
        logarithms = np.log(np.maximum(misses, RESOLUTION)).mean(axis=1)
        widths = Widths.of(fitted, points, covariances)
        result.append(Proven(widths, error_percent(truths, found), logarithms))
    return result


def _mean_and_error(values: Array) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values, ddof=1) / values.size**0.5)
