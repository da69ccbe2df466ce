"""CMA-ES of the library `cma`."""

from dataclasses import dataclass

import numpy as np

from emaphm.errors import MethodError
from emaphm.optimizers.adapters.library_fitness import LibraryFitness
from emaphm.optimizers.minimiser import Fitness, Minimiser, OnPopulation, Result
from emaphm.optional_library import import_library
from emaphm.random_streams import stream

SIGMA = 0.25
"""Initial standard deviation in widths of the box; the library recommends about a quarter."""


@dataclass(frozen=True, eq=False)
class CmaEs(Minimiser):
    """Covariance matrix adaptation evolution strategy [1], restarted with twice the population [2].

    The first start is the middle of the box, later starts are random points. The handling of bounds, the
    stopping criteria of a descent and all other settings are the library's defaults. Restarts continue until
    the budget is used.

    Parameters
    ----------
    lower, upper, iterations
        As in `Minimiser`.
    population
        Population of the first descent.

    Raises
    ------
    MethodError
        As in `Minimiser`; or the library is not installed, or the box has only one component, which the
        library does not support.

    References
    ----------
    .. [1] N. Hansen, A. Ostermeier, "Completely derandomized self-adaptation in evolution strategies",
       Evolutionary Computation 9, 2001.
    .. [2] A. Auger, N. Hansen, "A restart CMA evolution strategy with increasing population size",
       IEEE Congress on Evolutionary Computation, 2005.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lower.size < 2:
            raise MethodError("method 'cma-es' needs at least 2 components to search in, got 1")
        import_library("method 'cma-es'", "cma", "peers")

    def minimise(self, fitness: Fitness, seed: int, on_population: OnPopulation | None = None) -> Result:
        """Run the library until the budget is used; see `Minimiser.minimise`."""
        cma = import_library("method 'cma-es'", "cma", "peers")
        rng = stream(seed, "optimizer")
        start, population = np.full(self.lower.size, 0.5), self.population
        with LibraryFitness(self, fitness, on_population) as evaluate:
            while True:
                options = {
                    "bounds": [0, 1],
                    "popsize": population,
                    "randn": lambda *shape: rng.standard_normal(shape),
                    "seed": np.nan,  # the library does not seed NumPy's global generator
                    "verbose": -10,  # with -9 the library still reads options from the working directory
                }
                descent = cma.CMAEvolutionStrategy(start, SIGMA, options)
                while not descent.stop():
                    points = descent.ask()
                    descent.tell(points, evaluate(np.array(points)))
                start, population = rng.random(self.lower.size), 2 * population
        return evaluate.result()
