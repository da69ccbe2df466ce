"""Result of a search: one type for all methods."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.discrepancy import Discrepancy
from emaphm.estimation.global_search.smoothing import channel_means
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.sensors.sensor_model import described_noise
from emaphm.estimation.uncertainty.model_error import error_variance, largest_healthy_ratio
from emaphm.recording.noise import noise_level

DEFAULT_SCATTER = 2e-4
"""Default standard error of the optimiser's end point, used where its scatter was not measured: the distance
from the optimum at which kinks of stick-slip stop a descent, in the unit of a coordinate."""

EXPECTED_RESIDUAL = 1.1
"""Largest normalised residual that is expected of a correct estimate. Correct estimates had up to 1.03 with
the voltage recorded, at all noise levels, converters and rates, and up to 1.12 from the current alone (60
random faults). An undescribed lag of 5 µs of the current sensor gave 1.04 to 3.4, in 14 of 16 cases more
than 1.2."""

SMALLEST_SHARE = 5e-3
"""Residual, relative to the rms of the primary channel, that is always expected: with heavy shorts, estimates
with errors of 0.5 to 1.7 % have a residual of 0.2 to 0.4 % of a noise-free current."""

MOST_SWITCHING = 0.1
"""Largest switching, relative to the primary channel's rms, that is accepted as the cause of a residual
without a corresponding noise of the recording. With heavy shorts the reference model may be chaotic at a
wrong estimate: switching of 54 % accounted for a residual of 32 % of a current with 0.5 % of noise."""

NOISE_OF_SWITCHING = 2.0
"""Largest ratio of switching to noise of the recorded channel, both rms, that the recording can contain."""

SLOW_MEAN_S = 2e-3
"""Interval of the means of the residual, in which misfits of motions between rests are compared [s]."""

TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False)
class SearchResult:
    """An estimate, the outputs of the models at it, and whether the search has converged.

    Attributes
    ----------
    objective
        The objective that was minimised, with its final weights.
    point
        The estimate in the objective's coordinates, (d,).
    known_outputs
        The fitted model's outputs at the estimate, (rows,); None if the search did not compute them.
    correction
        Correction of the outputs during the search for the estimate, (rows,); 0 without correction.
    discrepancy
        Discrepancy of the models at the estimate itself; None if the reference model was not run.
    scatter
        Covariance (d, d) of the optimiser's end points, which is added to the covariance from the data.
    converged
        Whether the reference model found no better point nearby.
    jacobians
        Replicated Jacobians (n, d, channel rows) at the estimate, if they are known already.
    population_cost
        The value that a population method minimised, in the unit of its cost function; None otherwise.
    alternatives
        Results of other searches of the same recording, with the same description or with another law.
    started
        Whether the search began at given starts, without a global stage.
    """

    objective: MapObjective
    point: Array
    known_outputs: Array | None
    correction: Array
    discrepancy: Discrepancy | None
    scatter: Array
    converged: bool = False
    jacobians: Array | None = None
    population_cost: float | None = None
    alternatives: tuple["SearchResult", ...] = ()
    started: bool = False

    @classmethod
    def at(
        cls,
        objective: MapObjective,
        point: Array,
        *,
        outputs: Array | None = None,
        correction: Array | None = None,
        discrepancy: Discrepancy | None = None,
        population_cost: float | None = None,
    ) -> Self:
        """Return the result at `point` (d,), with the default scatter; not converged."""
        if correction is None:
            correction = np.zeros_like(objective.target)
        scatter = default_scatter(point.size)
        return cls(
            objective, point, outputs, correction, discrepancy, scatter, population_cost=population_cost
        )

    @cached_property
    def outputs(self) -> Array:
        """The fitted model's outputs at the estimate, (rows,)."""
        if self.known_outputs is None:
            return np.asarray(self.objective.outputs(self.point[np.newaxis])[0])
        return self.known_outputs

    @property
    def outputs_correction(self) -> Array:
        """The best known correction of the outputs at the estimate, (rows,): the discrepancy if known."""
        return self.correction if self.discrepancy is None else self.discrepancy.mean

    @property
    def residual(self) -> Array:
        """Measured minus modelled, (rows,), corrected by the discrepancy if it is known."""
        return self.objective.target - self.outputs - self.outputs_correction

    @property
    def fitted_residual(self) -> Array:
        """Measured minus modelled, (rows,), with the correction that the search used."""
        return self.objective.target - self.outputs - self.correction

    @property
    def compared_residual(self) -> Array:
        """The `fitted_residual` of the primary channel in the compared rows, (compared,)."""
        problem = self.objective.problem
        return problem.compared(problem.primary, self.fitted_residual[: problem.samples])

    @property
    def residual_by_channel(self) -> dict[str, Array]:
        """The `residual` of each channel in its own unit, (samples,)."""
        return self.by_channel(self.residual[: self.objective.channel_rows])

    def by_channel(self, residual: Array) -> dict[str, Array]:
        """Return a weighted `residual` (channel rows,) by channel, each (samples,) in its own unit."""
        problem = self.objective.problem
        rows = residual.reshape(len(problem.channels), -1) / problem.weights[:, np.newaxis]
        return dict(zip(problem.channels, rows, strict=True))

    @property
    def switching_variances(self) -> dict[str, float]:
        """The switching variance of each channel, in the square of its unit; empty if unknown."""
        if self.discrepancy is None or not self.discrepancy.channel_variances.size:
            return {}
        variances = self.discrepancy.channel_variances.tolist()
        return dict(zip(self.objective.problem.channels, variances, strict=True))

    @property
    def remaining_bias(self) -> Array:
        """The change of the outputs that a further correction would make, (rows,); 0 if unknown."""
        return self.outputs_correction - self.correction

    @property
    def cost(self) -> float:
        """The mean squared residual of the primary channel, or a population method's own cost."""
        if self.population_cost is not None:
            return self.population_cost
        return float(np.mean(self.fitted_residual[: self.objective.problem.samples] ** 2))

    @property
    def misfit(self) -> float:
        """The mean squared `residual` minus the squared standard error of the discrepancy, at least 0.

        If the shaft comes to rest, the mean square of means over `SLOW_MEAN_S`: nine tenths of a slow
        motion's residual are ripple, and the error of the estimate appears in the remaining tenth.
        """
        if self.objective.problem.rests is not None:
            return self._misfit_of_means
        error = 0.0 if self.discrepancy is None else float(np.mean(self.discrepancy.standard_error**2))
        return max(float(np.mean(self.residual**2)) - error, 0.0)

    @property
    def _misfit_of_means(self) -> float:
        """The mean square of the channels' `residual` in means over `SLOW_MEAN_S`, scaled to single rows."""
        objective = self.objective
        inputs = objective.problem.inputs
        count = int(np.clip(SLOW_MEAN_S / inputs.interval * (1 + 1e-9), 1, inputs.samples))
        return count * float(np.mean(channel_means(objective, self.residual, count) ** 2))

    @property
    def residual_variance(self) -> float:
        """The mean squared `residual` of the primary channel."""
        return float(np.mean(self.residual[: self.objective.problem.samples] ** 2))

    @property
    def residual_over_noise(self) -> float:
        """The rms residual of the primary channel relative to noise or switching, whichever is larger.

        The noise is estimated from the fast changes, which include the switching; `SMALLEST_SHARE` of the
        signal is added to it. The ratio is about 1 if estimate and model are correct. A search continues
        according to this ratio: a learned error of the model is no reason to stop before the optimum.
        """
        return self._relative_to(0.0)

    @property
    def normalised_residual(self) -> float:
        """The `residual_over_noise` with the learned error of the model added to the expected residual.

        It is about 1 if the estimate is correct, see `EXPECTED_RESIDUAL`. If an error was learned, the ratio
        is scaled so that `EXPECTED_RESIDUAL` stands for the learned limit of healthy recordings.
        """
        problem = self.objective.problem
        learned = problem.actuator.model_error.of(problem.primary)
        if learned is None:
            return self.residual_over_noise
        ratio = self._relative_to(error_variance(problem, problem.primary))
        return ratio * EXPECTED_RESIDUAL / largest_healthy_ratio(learned)

    @property
    def down_to_noise(self) -> bool:
        """Whether noise and switching account for the residual, according to `residual_over_noise`."""
        return self.residual_over_noise <= EXPECTED_RESIDUAL

    @property
    def residual_is_expected(self) -> bool:
        """Whether noise, switching and a learned error account for the residual (`normalised_residual`)."""
        return self.normalised_residual <= EXPECTED_RESIDUAL

    @property
    def residual_over_switching(self) -> float:
        """The largest of the `ratios_to_switching` of the `residual`."""
        return max(self.ratios_to_switching(self.residual_by_channel).values())

    def ratios_to_switching(self, residuals: Mapping[str, Array]) -> dict[str, float]:
        """Return the rms of each channel's residual relative to noise or switching, whichever is larger.

        `residuals` are (samples,) by channel, in its unit. No share of the signal is added to the noise: the
        ratios are about 1 at the true parameters if the reference model is correct.
        """
        switching = self.switching_variances
        return {
            name: math.sqrt(
                float(np.mean(residual**2)) / max(noise_level(residual) ** 2, switching.get(name, 0.0), TINY)
            )
            for name, residual in residuals.items()
        }

    @property
    def switching_variance(self) -> float:
        """The switching variance of the primary channel, limited to what the recording can contain."""
        return 0.0 if self.discrepancy is None else self._as_recorded(self.discrepancy.switching_variance)

    @property
    def slow_variance(self) -> float:
        """The part of the `switching_variance` that is too slow to count as noise."""
        return 0.0 if self.discrepancy is None else self._as_recorded(self.discrepancy.slow_variance)

    def _as_recorded(self, switching: float) -> float:
        """Return a `switching` variance, limited by the recording's noise or a share of its signal.

        The limit is the larger of (`NOISE_OF_SWITCHING` × noise)² and (`MOST_SWITCHING` × rms)².
        """
        problem = self.objective.problem
        largest = MOST_SWITCHING**2 * float(np.mean(problem.recorded**2))
        return min(switching, max(largest, NOISE_OF_SWITCHING**2 * problem.noise**2))

    @property
    def _noise_or_switching(self) -> float:
        """The variance of the primary channel that noise or switching account for."""
        return max(self.noise_level**2 + self.slow_variance, self.switching_variance)

    @property
    def _smallest_variance(self) -> float:
        """The variance of the residual that is always expected, from `SMALLEST_SHARE`."""
        return SMALLEST_SHARE**2 * float(np.mean(self.objective.problem.recorded**2))

    def _relative_to(self, error: float) -> float:
        """Return the rms residual relative to noise or switching plus a model error of variance `error`."""
        share = self.objective.problem.compared_share(self.objective.problem.primary)
        expected = self._noise_or_switching + share * (self._smallest_variance + error)
        return float(np.sqrt(self.residual_variance / max(expected, TINY)))

    @property
    def noise_level(self) -> float:
        """The rms of the white noise in the `residual` of the primary channel, in its unit.

        Rows that are not compared have a residual of 0 and lower the noise level. If the description states
        the noise of the channel's sensor, that value is used. Otherwise the noise is estimated from the
        measured channel and from the residual, and the smaller estimate is taken: the first counts a fast
        oscillation of the measured current as noise, the second counts an oscillation of the model as noise.
        """
        problem = self.objective.problem
        if described_noise(problem.primary, problem.actuator) is not None:
            return problem.noise * math.sqrt(problem.compared_share(problem.primary))
        residual = self.residual[: problem.samples] / problem.weights[0]
        return min(problem.noise, noise_level(residual))

    def reweighted(self) -> Self:
        """Return the result with its channels weighted by the inverse rms of its residuals."""
        return self.weighted_as(self.objective.reweighted(self.residual))

    def weighted_as(self, objective: MapObjective) -> Self:
        """Return the same result with the weights of `objective` on its rows."""
        before = self.objective
        discrepancy = self.discrepancy and self.discrepancy.rescaled(objective, before)
        return replace(
            self,
            objective=objective,
            known_outputs=objective.rescaled(self.outputs, before),
            correction=objective.rescaled(self.correction, before),
            discrepancy=discrepancy,
            jacobians=None,
        )


def default_scatter(dimensions: int) -> Array:
    """Return the scatter covariance (d, d) of a search whose scatter was not measured."""
    return DEFAULT_SCATTER**2 * np.eye(dimensions)
