"""Simulated tests: recordings of an excitation are simulated under known faults and diagnosed."""

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
"""Number of standard errors that an improvement must exceed."""


@dataclass(frozen=True, eq=False)
class SimulatedTests:
    """Diagnoses of simulated tests of an excitation: their `precision`, and `errors` [%] (tests,).

    `logarithms`, (tests,), are the means over the faults' coordinates of the logarithm of the error, like
    those of the `precision`: the error in percent is dominated by the component with the largest error.
    """

    precision: Precision
    errors: Array
    logarithms: Array

    @property
    def median_error(self) -> float:
        """Median error [%], defined by `emaphm.error_percent`."""
        return float(np.median(self.errors))


@dataclass(frozen=True)
class Gain:
    """Improvement of one excitation over another under the same faults, with standard errors.

    `narrower` is the mean difference of the logarithms of the half-widths, `nearer` that of the errors. They
    are positive if the intervals are narrower, or the estimates nearer to the truth.
    """

    narrower: float
    narrower_error: float
    nearer: float
    nearer_error: float

    @classmethod
    def of(cls, before: SimulatedTests, after: SimulatedTests) -> "Gain":
        """Return the improvement of `after` over `before`, from differences by fault vector."""
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
    """Return the results of `tests` simulated tests of each of `excitations`, all under the same faults."""
    faults = setup.faults(tests, seed)
    space = ParameterSpace.of(setup.actuator)
    estimated = np.array([i in space.columns for i in range(faults.shape[1])])
    # Components that the actuator lacks are healthy, so that they cause no error of a diagnosis.
    truths = np.where(estimated, faults, setup.faults(1, seed))
    results = []
    for i, excitation in enumerate(excitations):
        share = subprogress(on_progress, i / len(excitations), (i + 1) / len(excitations))
        results.append(_tested(setup, excitation, truths, seed, share))
    return results


def _tested(
    setup: TestSetup, excitation: Excitation, truths: Array, seed: int, on_progress: Progress | None
) -> SimulatedTests:
    """Return the results of simulated tests of `excitation` under `truths` (n, 8)."""
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
    estimates = np.array([diagnosis.faults.vector for diagnosis in diagnoses])
    points = space.points(estimates)
    errors = np.abs(points - space.points(truths))[:, : len(space.columns)]
    return SimulatedTests(
        Precision.of(space, points, np.array([diagnosis.covariance for diagnosis in diagnoses])),
        error_percent(truths, estimates),
        np.log(np.maximum(errors, DEFAULT_SCATTER)).mean(axis=1),
    )


def _mean_and_error(values: Array) -> tuple[float, float]:
    return float(np.mean(values)), float(np.std(values, ddof=1) / values.size**0.5)
