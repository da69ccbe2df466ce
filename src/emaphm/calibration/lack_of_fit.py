"""Lack of fit: residuals larger than noise and switching explain, and their effect on the standard errors.

A law that the description lacks leaves a residual, and shifts the estimates by a part that resembles the
parameters and does not appear in the residual. Under a Stribeck curve or load-dependent friction that was not
described, Coulomb friction deviated by 7 to 16 standard errors, with residuals of 1.4 to 3.6 times what
noise and switching explain.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.diagnosis.explanation.settings import RESIDUAL_LIMITS
from emaphm.diagnosis.explanation.unexplained import unexplained_scores
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.joint.correction import JointEstimate
from emaphm.estimation.search_result import EXPECTED_RESIDUAL, SearchResult

BY_CHANCE = 4.0
"""Limit of `slow_share` for n rows of white noise, in standard deviations 1/√n (von Neumann 1941)."""


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """Residual of one recording in a joint fit: `result` is its search result at the end of the fit."""

    result: SearchResult

    @property
    def residual(self) -> Array:
        """Measured less modelled primary channel, in its unit, (samples,)."""
        return next(iter(self.result.residual_by_channel.values()))

    @property
    def relative(self) -> float:
        """Rms residual of the primary channel divided by the rms of the channel."""
        size = rms(self.result.objective.problem.recorded)
        return rms(self.residual) / size if size > 0 else 0.0

    @property
    def ratio(self) -> float:
        """Rms residual of the primary channel divided by the rms of noise, rounding and switching."""
        expected = self.result.residual_variance / self.result.residual_over_noise**2
        rounding = float(self.result.objective.problem.rounding_errors[0])
        return float(np.sqrt(self.result.residual_variance / (expected + rounding**2)))

    @property
    def has_any(self) -> bool:
        """Whether the residual exceeds noise, rounding and switching by more than chance.

        The averaged model has no switching. Without a discrepancy, the limit for a drive that switches is
        therefore that of a diagnosis.
        """
        problem = self.result.objective.problem
        switching_unknown = (
            self.result.discrepancy is None or not self.result.discrepancy.standard_error.any()
        )
        largest = RESIDUAL_LIMITS[False].model
        if resolves_switching(problem) and switching_unknown and self.relative <= largest:
            return False
        by_chance = BY_CHANCE / problem.samples**0.5
        return self.ratio > EXPECTED_RESIDUAL and slow_share(self.residual) > by_chance

    def scores(self, jacobian: Array) -> Array:
        """Return the covariance (d, d) of the scores of `jacobian` (d, channel rows) by such a residual."""
        return unexplained_scores(self.result, jacobian)


def lack_of_fit(estimate: JointEstimate) -> tuple[LackOfFit, ...]:
    """Return the lack of fit of each recording at an estimate."""
    joint = estimate.joint
    return tuple(
        LackOfFit(
            SearchResult.at(
                term.objective,
                joint.local(r, estimate.point),
                outputs=term.objective.target - residual,
                discrepancy=discrepancy,
            )
        )
        for r, (term, residual, discrepancy) in enumerate(
            zip(joint.terms, estimate.residuals, estimate.discrepancies, strict=True)
        )
    )


def slow_share(residual: Array) -> float:
    """Return 1 less von Neumann's ratio of a `residual` (rows,), relative to that of white noise.

    It is 0 for white noise, and 1 for a residual that varies slowly from row to row.
    """
    square = float(np.mean(residual**2))
    return 1 - float(np.mean(np.diff(residual) ** 2)) / (2 * square) if square > 0 else 0.0
