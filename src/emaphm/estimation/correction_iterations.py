"""The iterations of a bias correction: of one recording's estimate, and of the one of a joint fit."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, Self, TypeVar

import numpy as np

from emaphm.progress import Progress


@dataclass(frozen=True)
class BiasCorrectionSettings:
    """How an iteration proposes candidates, and when the iterations end; `make study` shows the effect.

    An iteration descends, then takes the `step_shares` of a Gauss-Newton step by `replicates` Jacobians over
    differences of `jacobian_step`, `longest_step` at most. One that follows an iteration without progress
    adds `further_replicates` to them, and makes `further_descents`. Misfits within the factor `equal_misfits`
    count as equal: switching alone changes a misfit by about 10 %. Progress is a misfit below `progress`
    times the one before; after `patience` iterations without, the correction has converged.
    """

    step_shares: tuple[float, ...] = (0.0, 0.3, 1.0)
    jacobian_step: float = 2e-2
    replicates: int = 4
    longest_step: float = 0.1
    further_descents: int = 2
    further_replicates: int = 2
    equal_misfits: float = 1.2
    progress: float = 0.9
    patience: int = 3


BIAS_CORRECTION = BiasCorrectionSettings()

FROM_STARTS = BiasCorrectionSettings(patience=1)
"""From points that are near the optimum already: one iteration without progress is enough there. Errors are
those of three, and the reference runs a half (`python -m emaphm.study.estimators`)."""


def never(_: object) -> bool:
    """Return that an estimate is not given up."""
    return False


class Corrected(Protocol):
    """An estimate that the reference model has been compared at."""

    @property
    def misfit(self) -> float:
        """The mean or the sum of its squared residuals."""
        ...

    def reweighted(self) -> Self:
        """Return the estimate with recordings and channels weighted by its residuals."""
        ...


EstimateT = TypeVar("EstimateT", bound=Corrected)


@dataclass(frozen=True, eq=False)
class Iterated(Generic[EstimateT]):
    """Where iterations ended: the `estimate`, those of `equal` misfit, and whether they `converged`."""

    estimate: EstimateT
    equal: tuple[EstimateT, ...]
    converged: bool


def iterate(
    estimate: EstimateT,
    outcomes_of: Callable[[EstimateT, int, int], Sequence[EstimateT]],
    max_corrections: int,
    settings: BiasCorrectionSettings,
    on_progress: Progress | None,
    is_hopeless: Callable[[EstimateT], bool] = never,
) -> Iterated[EstimateT]:
    """Return where up to `max_corrections` iterations lead from `estimate`.

    Of the candidates whose misfit counts as equal to the smallest, each iteration takes the one with the
    longest step. Where even that is worse than the estimate by more than switching makes a misfit vary, the
    estimate stays.

    Parameters
    ----------
    outcomes_of
        Returns the candidates of an iteration, compared with the reference model, the longest step last.
        Called with the reweighted estimate, the number of the iteration, and the number of iterations without
        progress just before it.
    is_hopeless
        Whether to give an estimate up after one iteration without progress; it has not converged then.
    """
    idle, equal = 0, tuple[EstimateT, ...]()
    for iteration in range(max_corrections):
        estimate = estimate.reweighted()
        outcomes = outcomes_of(estimate, iteration, idle)
        misfits = np.array([outcome.misfit for outcome in outcomes])
        farthest = int(np.flatnonzero(misfits <= settings.equal_misfits * misfits.min())[-1])
        idle = 0 if misfits[farthest] < settings.progress * estimate.misfit else idle + 1
        if misfits[farthest] <= settings.equal_misfits * estimate.misfit:
            estimate = outcomes[farthest]
            equal = (*equal, estimate) if idle else ()
        if idle == settings.patience:
            return Iterated(estimate, equal, converged=True)
        if idle and is_hopeless(estimate):
            break
        if on_progress:
            on_progress((iteration + 1) / max_corrections)
    return Iterated(estimate, equal, converged=False)
