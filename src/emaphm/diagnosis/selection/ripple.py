"""Residual of the current's ripple: rows in which all runs switch alike have the largest weight."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.selection.rivals import compared_anew
from emaphm.estimation.discrepancy import REFERENCE_RUNS
from emaphm.estimation.search_result import SearchResult


@dataclass(frozen=True, eq=False)
class RippleResidual:
    """The residual (rows,) of the primary channel from the mean of several `runs` of the reference model.

    `switching` (rows,) is the variance of switching in one run.
    """

    residual: Array
    switching: Array
    runs: int

    @classmethod
    def of(cls, result: SearchResult) -> Self:
        """Return the residual of `result`, which is a comparison with the reference model."""
        discrepancy, rows = result.discrepancy, result.objective.problem.samples
        assert discrepancy is not None  # noqa: S101 - every result of a comparison has one
        return cls(
            result.residual[:rows],
            discrepancy.runs * discrepancy.standard_error[:rows] ** 2,
            discrepancy.runs,
        )

    def together_with(self, other: Self) -> Self:
        """Return the residual from the runs of both, of equal number and at the same point."""
        residual, switching = (self.residual + other.residual) / 2, (self.switching + other.switching) / 2
        return type(self)(residual, switching, self.runs + other.runs)

    def less(self, other: Self) -> Self:
        """Return the difference of two residuals with equal numbers of runs."""
        return type(self)(self.residual - other.residual, self.switching + other.switching, self.runs)


def ripple_powers(residuals: Sequence[RippleResidual], noise: float) -> Array:
    """Return the mean squared residual of each, (n,), its rows weighted by their variance.

    Rows in which the runs agree have the largest weight. The variance is the mean variance of all residuals
    plus that of the `noise`, given as rms. The contribution of switching to the mean of few runs is
    subtracted.
    """
    switching = np.mean([residual.switching for residual in residuals], axis=0)
    variance_of_mean = float(np.mean([1 / residual.runs for residual in residuals]))
    variance = switching * (1 + variance_of_mean) + noise**2
    # Without switching and noise all rows have equal weight.
    weights = (
        1 / np.maximum(variance, np.finfo(float).eps * variance.max()) if variance.any() else variance + 1
    )
    weights /= weights.sum()
    powers = [
        float(weights @ (residual.residual**2 - residual.switching / residual.runs)) for residual in residuals
    ]
    return np.maximum(powers, np.finfo(float).tiny)


def ripple_share(tried: SearchResult, before: SearchResult, seed: int) -> float:
    """Return the ratio of the residuals of `tried` and `before`, by many runs of the reference model.

    The residuals are those of the primary channel, with the weights of `ripple_powers`.
    """
    rows = before.objective.problem.samples
    residuals = []
    for estimate in (tried, before):
        comparisons = compared_anew(estimate, seed)
        mean = np.mean([comparison.mean[:rows] for comparison in comparisons], axis=0)
        switching = REFERENCE_RUNS * np.mean(
            [comparison.standard_error[:rows] ** 2 for comparison in comparisons], axis=0
        )
        residual = (estimate.objective.target - estimate.outputs)[:rows] - mean
        residuals.append(RippleResidual(residual, switching, REFERENCE_RUNS * len(comparisons)))
    powers = ripple_powers(residuals, before.noise_level)
    return float(powers[0] / powers[1])
