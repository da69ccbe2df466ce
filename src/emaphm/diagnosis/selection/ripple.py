"""What an estimate leaves of a current where its ripple repeats: the switching shows there."""

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
    """What the mean of several `runs` of the reference model leaves of the primary channel, (rows,).

    And the `switching` variance of one run, (rows,).
    """

    residual: Array
    switching: Array
    runs: int

    @classmethod
    def of(cls, result: SearchResult) -> Self:
        """Return what `result` leaves, of a comparison with the reference model."""
        known, rows = result.discrepancy, result.objective.problem.samples
        assert known is not None  # noqa: S101 - every result of a comparison has one
        return cls(result.residual[:rows], known.runs * known.standard_error[:rows] ** 2, known.runs)

    def together_with(self, other: Self) -> Self:
        """Return what the runs of both leave, as many in each, at the same point."""
        residual, switching = (self.residual + other.residual) / 2, (self.switching + other.switching) / 2
        return type(self)(residual, switching, self.runs + other.runs)

    def less(self, other: Self) -> Self:
        """Return what separates two residuals, of means over as many runs."""
        return type(self)(self.residual - other.residual, self.switching + other.switching, self.runs)


def ripple_powers(residuals: Sequence[RippleResidual], noise: float) -> Array:
    """Return the mean squared residual of each, (n,), its rows weighted by their variance.

    The rows where the runs agree say most. The variance is the mean over all of them, with that of the
    `noise`, its rms. What a mean over few runs has of the switching is subtracted.
    """
    switching = np.mean([one.switching for one in residuals], axis=0)
    in_mean = float(np.mean([1 / one.runs for one in residuals]))
    variance = switching * (1 + in_mean) + noise**2
    # Neither switching nor noise: all rows say as much.
    weights = (
        1 / np.maximum(variance, np.finfo(float).eps * variance.max()) if variance.any() else variance + 1
    )
    weights /= weights.sum()
    powers = [float(weights @ (one.residual**2 - one.switching / one.runs)) for one in residuals]
    return np.maximum(powers, np.finfo(float).tiny)


def ripple_share(tried: SearchResult, before: SearchResult, seed: int) -> float:
    """Return what `tried` leaves of the residual that `before` leaves, by many runs of the reference model.

    The residual of the primary channel, its rows weighted as by `ripple_powers`.
    """
    rows = before.objective.problem.samples
    residuals = []
    for one in (tried, before):
        known = compared_anew(one, seed)
        mean = np.mean([each.mean[:rows] for each in known], axis=0)
        switching = REFERENCE_RUNS * np.mean([each.standard_error[:rows] ** 2 for each in known], axis=0)
        left = (one.objective.target - one.outputs)[:rows] - mean
        residuals.append(RippleResidual(left, switching, REFERENCE_RUNS * len(known)))
    powers = ripple_powers(residuals, before.noise_level)
    return float(powers[0] / powers[1])
