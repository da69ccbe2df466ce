"""Refits of an estimate under another explanation, and their residuals."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.global_search.multistart import descents_from, local_search
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import TINY, SearchResult
from emaphm.random_streams import stream

PROMISING, CORRECTIONS = 1.5, 2
"""Largest residual of descents that are corrected, relative to before, and number of corrections."""


@dataclass(frozen=True, eq=False)
class Refit:
    """End point of descents: the `point` (d,) of an `objective`, and the residual there.

    `mean_square` is the mean squared residual of channels and priors, including the error of rounding;
    `error` is the contribution of the discrepancy's standard error to it, which depends on the number of runs
    of the reference model.
    """

    objective: MapObjective
    point: Array
    mean_square: float
    error: float

    @classmethod
    def under(cls, objective: MapObjective, starts: Array, corrected: SearchResult) -> "Refit":
        """Return the end of descents from `starts` (n, d) with the correction of the estimate `corrected`."""
        correction = corrected.outputs_correction
        point = descents_from(objective, starts, correction).best
        discrepancy = corrected.discrepancy
        error = 0.0 if discrepancy is None else float(np.mean(discrepancy.standard_error**2))
        mean_square = objective.mean_square(objective.residual(point, correction))
        return cls(objective, point, max(mean_square, TINY), error)

    @property
    def misfit(self) -> float:
        """The mean squared residual without the contribution of the discrepancy's error."""
        return max(self.mean_square - self.error, TINY)

    def corrected(self, before: "Refit", seed: int, name: str) -> "Refit":
        """Return the refit corrected by the reference model, as long as this reduces the residual.

        It is corrected if its residual is larger than that of `before`, by a factor less than `PROMISING`.
        """
        best, objective, reference = self, self.objective, None
        for iteration in range(CORRECTIONS):
            if not 1.0 <= best.mean_square / before.mean_square < PROMISING:
                break
            reference = reference or reference_problem(objective)
            rng = stream(seed, f"reference runs of {name}", iteration)
            (comparison,) = compared(objective, best.point[np.newaxis], reference, rng)
            further = Refit.under(objective, best.point[np.newaxis], comparison)
            if further.mean_square >= best.mean_square:
                break
            best = further
        return best


def mean_square_after_descents(
    result: SearchResult, objective: MapObjective, correction: Array, count: int, rng: np.random.Generator
) -> float:
    """Return the mean squared residual of the channels after `count` descents from the estimate.

    The `objective` has the coordinates of the estimate; `correction` (rows,) is that of its outputs.
    """
    point = local_search(objective, result.point, correction, rng, count).best
    return objective.mean_square(objective.residual(point, correction)[: objective.channel_rows])
