"""Simulated tests: an excitation is recorded under known faults, and the recordings are diagnosed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.diagnose import diagnose
from emaphm.diagnosis.error_metric import error_percent
from emaphm.estimation.search_result import DEFAULT_SCATTER
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.experiment.excitation import Excitation
from emaphm.experiment.predicted_precision import Precision
from emaphm.experiment.test_setup import TestSetup
from emaphm.progress import Progress, subprogress

SIGNIFICANT = 2.0
"""Standard errors that an improvement must exceed."""


@dataclass(frozen=True, eq=False)
class SimulatedTests:
    """Diagnoses of simulated tests of an excitation: their `precision`, and `errors` [%] (tests,).

    `logarithms`, (tests,), are the means over the faults' coordinates of the logarithm of the error, as
    those of the `precision` are: an error in percent is that of the worst-known component alone.
    """

    precision: Precision
    errors: Array
    logarithms: Array

    @property
    def median_error(self) -> float:
        """The median error [%], as `emaphm.error_percent`."""
        return float(np.median(self.errors))


@dataclass(frozen=True)
class Gain:
    """How much one excitation does better than another on the same faults, and its standard error.

    `narrower` is the mean difference of the logarithms of the half-widths, `nearer` that of the errors';
    above 0 where the intervals are narrower, or the estimates nearer to the truth.
    """

    narrower: float
    narrower_error: float
    nearer: float
    nearer_error: float

    @classmethod
    def of(cls, before: SimulatedTests, after: SimulatedTests) -> "Gain":
        """Return what `after` gains on `before`, fault vector by fault vector."""
        narrower = before.precision.logarithms - after.precision.logarithms
        return cls(*_mean_and_error(narrower), *_mean_and_error(before.logarithms - after.logarithms))

    @property
    def significant(self) -> bool:
        """Whether the intervals are significantly narrower, and the errors not significantly larger."""
        return (
            self.narrower > SIGNIFICANT * self.narrower_error
            and self.nearer >= -SIGNIFICANT * self.nearer_error
        )


def simulate_tests(
    setup: TestSetup,
    excitations: Sequence[Excitation],
    tests: int,
    seed: int,
    on_progress: Progress | None = None,
) -> list[SimulatedTests]:
    """Return the diagnoses of `tests` simulated tests of each of `excitations`, all under the same faults."""
    faults = setup.faults(tests, seed)
    space = ParameterSpace.of(setup.actuator)
    shown = np.array([i in space.columns for i in range(faults.shape[1])])
    # A fault that the actuator cannot show is no error of a diagnosis.
    truths = np.where(shown, faults, setup.faults(1, seed))
    results = []
    for i, excitation in enumerate(excitations):
        share = subprogress(on_progress, i / len(excitations), (i + 1) / len(excitations))
        results.append(_tested(setup, excitation, truths, seed, share))
    return results


def _tested(
    setup: TestSetup, excitation: Excitation, truths: Array, seed: int, on_progress: Progress | None
) -> SimulatedTests:
    """Return the diagnoses of simulated tests of `excitation` under `truths` (n, 8)."""
    space = setup.objective(excitation).space
    diagnoses = []
    for i, recording in enumerate(setup.record(excitation, truths, seed)):
        diagnoses.append(
            diagnose(
                recording,
                setup.actuator,
                nuisances=space.nuisances.chosen,
                seed=seed,
                workers=setup.workers,
            )
        )
        if on_progress is not None:
            on_progress((i + 1) / len(truths))
    found = np.array([diagnosis.faults.vector for diagnosis in diagnoses])
    points = space.points(found)
    misses = np.abs(points - space.points(truths))[:, : len(space.columns)]
    return SimulatedTests(
        Precision.of(space, points, np.array([diagnosis.covariance for diagnosis in diagnoses])),
        error_percent(truths, found),
        np.log(np.maximum(misses, DEFAULT_SCATTER)).mean(axis=1),
    )


def _mean_and_error(values: Array) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values, ddof=1) / values.size**0.5)
