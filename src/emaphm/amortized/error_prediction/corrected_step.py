"""Where the reference model would move an estimator's answer, and what it would leave.

An answer that is right to its standard deviations has the optimum of the corrected model within these, and
noise and switching for a residual there. Neither holds of most recordings of another actuator, which the
averaged model, with its known error, may explain all the same.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.search_result import SearchResult

FARTHEST = 3.5
"""Standard deviations of the answer from which on a step from it is not believed. Of 48 recordings as in the
training 2.6 at most; 3.8 to 7.8 of a Stribeck speed, a pole pair more, an inductance 14 % off, and a load
five standard deviations of its prior off."""

MOST_LEFT = 1.3
"""Residual over noise and switching from which on it is not that of a right model: of the same 48 recordings
1.14 at most; 1.7 of the Stribeck speed, 24 of rows that come one early."""


@dataclass(frozen=True)
class CorrectedStep:
    """The step to the optimum of the linear model, by an answer's prior and the corrected residual.

    `name` is the coordinate that it moves farthest, by `deviations` of the answer; `left` the largest rms
    residual of a channel after it, over that of noise and switching, and `channel` which that is.
    """

    name: str
    deviations: float
    channel: str
    left: float

    @classmethod
    def of(cls, result: SearchResult, covariance: Array) -> Self:
        """Return the step from an answer of `covariance` (d, d); `result` has a discrepancy and Jacobians."""
        assert result.jacobians is not None  # noqa: S101 - they were made with the answer
        objective = result.objective
        residual, jacobian = result.residual[: objective.channel_rows], result.jacobians.mean(axis=0)
        variance = float(np.mean(residual**2))
        deviations = np.sqrt(np.diag(covariance))
        # In standard deviations of the answer: the prior is then well conditioned.
        scaled = jacobian * deviations[:, np.newaxis]
        prior = np.linalg.inv(covariance / np.outer(deviations, deviations))
        step = np.linalg.solve(scaled @ scaled.T / variance + prior, scaled @ residual / variance)
        farthest = int(np.abs(step).argmax())
        left = result.ratios_to_switching(result.by_channel(residual - scaled.T @ step))
        channel = max(left, key=left.__getitem__)
        return cls(objective.space.coordinates[farthest], float(abs(step[farthest])), channel, left[channel])

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the answer is not believed, a clause each."""
        reasons = []
        if self.deviations > FARTHEST:
            reasons.append(
                f"the reference model moves it by {self.deviations:.2g} of its standard deviations in "
                f"{self.name}"
            )
        if self.left > MOST_LEFT:
            reasons.append(
                f"{self.left:.2g} times what noise and switching explain of {self.channel} is left, also "
                "where the reference model moves it to"
            )
        return tuple(reasons)
