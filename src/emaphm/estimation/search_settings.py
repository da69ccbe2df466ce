"""With what a search is run: its method, its corrections of the model's bias, and its random numbers."""

from dataclasses import dataclass, replace
from typing import Self

from emaphm.estimation.methods import Method
from emaphm.random_streams import child_seed


@dataclass(frozen=True)
class SearchSettings:
    """The `method` of a search, the most corrections of the model's bias, and the seed of its random numbers.

    Corrections follow least squares; 0 turns them off.
    """

    method: Method
    max_corrections: int
    seed: int

    def child(self, *name: str | int) -> Self:
        """Return the settings of the sub-search `name`, whose random numbers are its own."""
        return replace(self, seed=child_seed(self.seed, *name))
