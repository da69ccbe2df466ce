"""Random search: the baseline of all other optimisers."""

from dataclasses import dataclass, replace

from emaphm.arrays import Array
from emaphm.optimizers.base import Optimizer, State


@dataclass(frozen=True, eq=False)
class RandomSearch(Optimizer[State]):
    """Random search: every population is drawn uniformly from the box.

    m points miss a region with the share V of the box's volume with probability (1 - V)^m [1]. The advantage
    of another optimiser over this search is due to its use of the fitness.

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

    def _move(self, state: State, fitness: Array) -> State:  # noqa: ARG002 - the fitness is not used
        return replace(state, positions=self._scatter(self._random(state.seed, state.iteration)))
