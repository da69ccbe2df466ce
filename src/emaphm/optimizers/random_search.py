"""Random search: the baseline that any other optimiser must beat."""

from dataclasses import dataclass, replace

from emaphm.arrays import Array
from emaphm.optimizers.base import Optimizer, State


@dataclass(frozen=True, eq=False)
class RandomSearch(Optimizer[State]):
    """Random search: every population is drawn anew, uniformly from the box.

    m points miss a part V of the box, as a fraction of its volume, with probability (1 - V)^m [1]: what an
    optimiser gains on this is what it learns from the fitness.

    Parameters
    ----------
    lower, upper, population, iterations
        As in `Optimizer`.

    Raises
    ------
    MethodError
        As in `Optimizer`.

    References
    ----------
    .. [1] S. H. Brooks, "A discussion of random methods for seeking maxima", Operations Research 6, 1958.
    """

    def init(self, seed: int) -> State:
        """Return the first random population."""
        return self._start(State, seed, self._scatter(self._random(seed, 0)))

    def _move(self, state: State, fitness: Array) -> State:  # noqa: ARG002 - it learns nothing
        return replace(state, positions=self._scatter(self._random(state.seed, state.iteration)))
