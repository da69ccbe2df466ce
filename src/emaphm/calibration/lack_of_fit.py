"""Recordings of which a calibrated model leaves more than noise and switching, and what that makes of errors.

A law that the description lacks leaves a part of the signal, and moves the estimates by another part, which
is like the parameters and does not show: Coulomb friction was 7 to 16 standard errors off under a Stribeck
curve, or under friction by the load, where 1.4 to 3.6 times what noise and switching explain was left.
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
"""Largest share of the mean square of n rows of white noise that is no such noise by its differences, in the
standard deviation 1/√n of that share (von Neumann 1941)."""


@dataclass(frozen=True, eq=False)
class LackOfFit:
    """What a joint fit leaves of one recording: its `result`, at the end of the fit."""

    result: SearchResult

    @property
    def residual(self) -> Array:
        """Measured less modelled of the primary channel, in its unit, (samples,)."""
        return next(iter(self.result.residual_by_channel.values()))

    @property
    def relative(self) -> float:
        """The rms residual of the primary channel over that of the channel."""
        size = rms(self.result.objective.problem.recorded)
        return rms(self.residual) / size if size > 0 else 0.0

    @property
    def ratio(self) -> float:
        """The rms residual of the primary channel over that of noise, rounding and switching."""
        expected = self.result.residual_variance / self.result.residual_over_noise**2
        rounding = float(self.result.objective.problem.rounding_errors[0])
        return float(np.sqrt(self.result.residual_variance / (expected + rounding**2)))

    @property
    def has_any(self) -> bool:
        """Whether noise, rounding and switching leave less, by more than chance.

        The averaged model alone has no switching: of a drive that switches it is allowed what it is in a
        diagnosis.
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
        """Return the covariance (d, d) of `jacobian` (d, channel rows) times an error like the residual."""
        return unexplained_scores(self.result, jacobian)


def lack_of_fit(estimate: JointEstimate) -> tuple[LackOfFit, ...]:
    """Return what an estimate leaves of each recording."""
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
    """Return the share of the mean square of a `residual` (rows,) that is not as white noise.

    1 for a slow one, 0 for white noise, by von Neumann's ratio.
    """
    square = float(np.mean(residual**2))
    return 1 - float(np.mean(np.diff(residual) ** 2)) / (2 * square) if square > 0 else 0.0
