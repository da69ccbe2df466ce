"""L-SHADE of the library `minionpy`."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from emaphm.optimizers.adapters.library_fitness import LibraryFitness
from emaphm.optimizers.minimiser import Fitness, Minimiser, OnPopulation, Result
from emaphm.optional_library import import_library
from emaphm.random_streams import child_seed


@dataclass(frozen=True, eq=False)
class LShade(Minimiser):
    """Differential evolution that adapts F and CR from successful trials and reduces its population [1].

    Settings are the library's defaults, which are those of [1] with two exceptions: a component outside the
    bounds is drawn again, not set halfway, and the search ends if the population is within 1e-8 of the box.
    The library has one generator per thread: a fitness must not start another L-SHADE search.

    Parameters
    ----------
    lower, upper, iterations
        As in `Minimiser`.
    population
        Initial population; it falls linearly to 4 at the end of the budget. 18 times the dimensions in [1].

    Raises
    ------
    MethodError
        As in `Minimiser`; or the library is not installed.

    References
    ----------
    .. [1] R. Tanabe, A. S. Fukunaga, "Improving the search performance of SHADE using linear population
       size reduction", IEEE Congress on Evolutionary Computation, 2014.
    """

    least_population: ClassVar[int] = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        import_library("method 'l-shade'", "minionpy", "peers")

    def minimise(self, fitness: Fitness, seed: int, on_population: OnPopulation | None = None) -> Result:
        """Run the library; see `Minimiser.minimise`."""
        algorithms = import_library("method 'l-shade'", "minionpy.algorithms", "peers")
        with LibraryFitness(self, fitness, on_population) as evaluate:
            search = algorithms.LSHADE(
                lambda points: evaluate(np.array(points)).tolist(),
                bounds=[(0.0, 1.0)] * self.lower.size,
                maxevals=self.budget,
                seed=child_seed(seed, "optimizer"),
                options={"population_size": self.population},
            )
            try:
                search.optimize()
            finally:
                del search.optimizer  # a reference cycle through compiled code is never collected
        return evaluate.result()
