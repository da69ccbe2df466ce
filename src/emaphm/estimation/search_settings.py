"""Settings of a search: method, number of bias corrections, and seed of the random numbers."""

from dataclasses import dataclass, replace
from typing import Self

from emaphm.estimation.methods import Method
from emaphm.random_streams import child_seed


@dataclass(frozen=True)
class SearchSettings:
    """The `method` of a search, its largest number of bias corrections, and the seed of its random numbers.

    Corrections follow least squares; 0 disables them.
    """

    method: Method
    max_corrections: int
    seed: int

    def child(self, *name: str | int) -> Self:
        """Return the settings of the sub-search `name`, which has its own random numbers."""
        return replace(self, seed=child_seed(self.seed, *name))
