"""Refits of an estimate under another explanation, and what they leave of the recording."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.global_search.multistart import descents_from, local_search, with_descents
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import TINY, SearchResult
from emaphm.random_streams import stream

PROMISING, CORRECTIONS = 1.5, 2
"""How many times as much descents may leave to be corrected by the reference model, and how often at most."""


@dataclass(frozen=True, eq=False)
class Refit:
    """Where descents ended: the `point` (d,) of an `objective`, and the `mean_square` of the residual there.

    It is of channels and priors, with what counts leave open of it; `error` is what the discrepancy's
    standard error adds to it: refits may be corrected by means of more runs of the reference model or of
    fewer.
    """

    objective: MapObjective
    point: Array
    mean_square: float
    error: float

    @classmethod
    def under(cls, objective: MapObjective, starts: Array, corrected: SearchResult) -> "Refit":
        """Return where descents from `starts` (n, d) lead under the correction of an estimate."""
        correction = corrected.outputs_correction
        point = descents_from(objective, starts, correction).best
        known = corrected.discrepancy
        error = 0.0 if known is None else float(np.mean(known.standard_error**2))
        mean_square = objective.mean_square(objective.residual(point, correction))
        return cls(objective, point, max(mean_square, TINY), error)

    @property
    def misfit(self) -> float:
        """What is left but for the discrepancy's error."""
        return max(self.mean_square - self.error, TINY)

    def corrected(self, before: "Refit", seed: int, name: str) -> "Refit":
        """Return the refit corrected by the reference model, while that leads on.

        Where more is left than `before`, and less than `PROMISING` times as much.
        """
        best, objective, reference = self, self.objective, None
        for iteration in range(CORRECTIONS):
            if not 1.0 <= best.mean_square / before.mean_square < PROMISING:
                break
            reference = reference or reference_problem(objective)
            rng = stream(seed, f"reference runs of {name}", iteration)
            none = np.zeros_like(objective.target)
            comparison = compared(objective, none, best.point[np.newaxis], reference, rng)[0]
            further = Refit.under(objective, best.point[np.newaxis], comparison)
            if further.mean_square >= best.mean_square:
                break
            best = further
        return best


def mean_square_after_descents(
    result: SearchResult, objective: MapObjective, correction: Array, count: int, rng: np.random.Generator
) -> float:
    """Return the mean squared residual of the channels after `count` descents from the estimate.

    Of an `objective` with the estimate's coordinates, under a `correction` (rows,).
    """
    point = local_search(objective, result.point, correction, rng, with_descents(count)).best
    return objective.mean_square(objective.residual(point, correction)[: objective.channel_rows])
