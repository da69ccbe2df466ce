"""Iterations of a bias correction, of the estimate of one recording or of a joint fit."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, Self, TypeVar

import numpy as np

from emaphm.arrays import Array
from emaphm.progress import Progress


@dataclass(frozen=True)
class BiasCorrectionSettings:
    """Settings of an iteration's candidates and of the stopping rule; `make study` measures their effect.

    An iteration runs a descent, then takes the `step_shares` of a Gauss-Newton step of length `longest_step`
    at most, from `replicates` Jacobians over differences of `jacobian_step`. After an iteration without
    progress, the next iteration adds `further_replicates` Jacobians and runs `further_descents` descents.
    Misfits within the factor `equal_misfits` count as equal: switching alone changes a misfit by about 10 %.
    Progress is a misfit below `progress` times the previous misfit; after `patience` iterations without
    progress, the correction has converged.
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

    def steps_along(self, step: Array) -> Array:
        """Return the shares (n, d) of a Gauss-Newton `step` (d,), shortened to the longest length."""
        return np.asarray(np.array(self.step_shares)[:, np.newaxis] * shortened(step, self.longest_step))


BIAS_CORRECTION = BiasCorrectionSettings()


def shortened(step: Array, longest: float) -> Array:
    """Return a `step` (d,) in its direction, with a length of `longest` at most."""
    return np.asarray(step * (longest / max(float(np.linalg.norm(step)), longest)))


def never(_: object) -> bool:
    """Return False: no estimate is hopeless."""
    return False


class Corrected(Protocol):
    """An estimate at which the reference model was compared."""

    @property
    def misfit(self) -> float:
        """The mean or the sum of the squared residuals."""
        ...

    def reweighted(self) -> Self:
        """Return the estimate with recordings and channels weighted according to its residuals."""
        ...


EstimateT = TypeVar("EstimateT", bound=Corrected)


@dataclass(frozen=True, eq=False)
class Iterated(Generic[EstimateT]):
    """Result of iterations: last `estimate`, estimates of `equal` misfit, and whether they `converged`."""

    estimate: EstimateT
    equal: tuple[EstimateT, ...]
    converged: bool


def iterate(
    estimate: EstimateT,
    outcomes_of: Callable[[EstimateT, int, int], Sequence[EstimateT]],
    max_corrections: int,
    on_progress: Progress | None,
    is_hopeless: Callable[[EstimateT], bool] = never,
) -> Iterated[EstimateT]:
    """Return the result of up to `max_corrections` iterations from `estimate`.

    Each iteration takes the candidate with the longest step among those whose misfit counts as equal to the
    smallest. If the misfit of that candidate exceeds the estimate's misfit by more than the effect of
    switching (`equal_misfits`), the estimate stays.

    Parameters
    ----------
    outcomes_of
        Returns the candidates of an iteration, compared with the reference model, ordered by step length.
        Its arguments are the reweighted estimate, the number of the iteration, and the number of consecutive
        iterations without progress before it.
    is_hopeless
        Whether to stop after one iteration without progress; the estimate has then not converged.
    """
    idle, equal = 0, tuple[EstimateT, ...]()
    for iteration in range(max_corrections):
        estimate = estimate.reweighted()
        outcomes = outcomes_of(estimate, iteration, idle)
        misfits = np.array([outcome.misfit for outcome in outcomes])
        farthest = int(np.flatnonzero(misfits <= BIAS_CORRECTION.equal_misfits * misfits.min())[-1])
        idle = 0 if misfits[farthest] < BIAS_CORRECTION.progress * estimate.misfit else idle + 1
        if misfits[farthest] <= BIAS_CORRECTION.equal_misfits * estimate.misfit:
            estimate = outcomes[farthest]
            equal = (*equal, estimate) if idle else ()
        if idle == BIAS_CORRECTION.patience:
            return Iterated(estimate, equal, converged=True)
        if idle and is_hopeless(estimate):
            break
        if on_progress:
            on_progress((iteration + 1) / max_corrections)
    return Iterated(estimate, equal, converged=False)
