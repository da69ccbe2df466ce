"""Step by which the reference model would correct an estimator's answer, and the residual after it.

If an answer is correct within its standard deviations, the optimum of the corrected model lies within these,
and its residual is noise and switching. Neither is the case for most recordings of an actuator that deviates
from the description, although the averaged model, with its known error, may explain them.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.search_result import SearchResult

FARTHEST = 3.5
"""Largest step from an accepted answer, in its standard deviations. For 48 recordings like those of the
training it was 2.6 at most. It was 3.8 to 7.8 with a Stribeck speed, with one more pole pair, with an
inductance that deviated by 14 %, and with a load that deviated by five standard deviations of its prior."""

LARGEST_RESIDUAL_RATIO = 1.3
"""Largest residual of a correct model, relative to noise and switching: it was 1.14 at most for the same 48
recordings, 1.7 with the Stribeck speed, and 24 with rows that were one early."""


@dataclass(frozen=True)
class CorrectedStep:
    """The step to the optimum of the linear model, with the answer as prior and the corrected residual.

    `name` is the coordinate with the largest step, of `deviations` standard deviations of the answer.
    `channel` is the channel with the largest rms residual after the step, relative to that of noise and
    switching, which is `residual_ratio`.
    """

    name: str
    deviations: float
    channel: str
    residual_ratio: float

    @classmethod
    def of(cls, result: SearchResult, covariance: Array) -> Self:
        """Return the step from an answer of `covariance` (d, d); `result` has a discrepancy and Jacobians."""
        assert result.jacobians is not None  # noqa: S101 - they were made with the answer
        objective = result.objective
        residual, jacobian = result.residual[: objective.channel_rows], result.jacobians.mean(axis=0)
        variance = float(np.mean(residual**2))
        deviations = np.sqrt(np.diag(covariance))
        # The unit is the standard deviation of the answer, so that the prior is well conditioned.
        scaled = jacobian * deviations[:, np.newaxis]
        prior = np.linalg.inv(covariance / np.outer(deviations, deviations))
        step = np.linalg.solve(scaled @ scaled.T / variance + prior, scaled @ residual / variance)
        farthest = int(np.abs(step).argmax())
        ratios = result.ratios_to_switching(result.by_channel(residual - scaled.T @ step))
        channel = max(ratios, key=ratios.__getitem__)
        name = objective.space.coordinates[farthest]
        return cls(name, float(abs(step[farthest])), channel, ratios[channel])

    @property
    def reasons(self) -> tuple[str, ...]:
        """The reasons why the answer is not accepted, a clause each."""
        reasons = []
        if self.deviations > FARTHEST:
            reasons.append(
                f"the reference model moves it by {self.deviations:.2g} of its standard deviations in "
                f"{self.name}"
            )
        if self.residual_ratio > LARGEST_RESIDUAL_RATIO:
            reasons.append(
                f"the residual of {self.channel} is {self.residual_ratio:.2g} times that of noise and "
                "switching, even where the reference model moves it to"
            )
        return tuple(reasons)
