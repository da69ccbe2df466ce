"""Differential evolution of SciPy."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from emaphm.arrays import Array
from emaphm.optimizers.adapters.library_fitness import LibraryFitness
from emaphm.optimizers.minimiser import Fitness, Minimiser, OnPopulation, Result
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class ScipyDE(Minimiser):
    """`scipy.optimize.differential_evolution`, with one call per generation and without the final polish.

    All other settings are SciPy's defaults: best/1/bin with F drawn from [0.5, 1] in each generation,
    CR = 0.7, a Latin hypercube as first population; the search ends if the standard deviation of the
    population's fitness is less than 1 % of its mean.

    Parameters
    ----------
    lower, upper, iterations
        As in `Minimiser`.
    population
        Number of agents, not SciPy's multiple of the dimensions.

    Raises
    ------
    MethodError
        As in `Minimiser`.
    """

    least_population: ClassVar[int] = 5

    def minimise(self, fitness: Fitness, seed: int, on_population: OnPopulation | None = None) -> Result:
        """Run SciPy; see `Minimiser.minimise`."""
        from scipy.optimize import Bounds, differential_evolution
        from scipy.stats import qmc

        d, rng = self.lower.size, stream(seed, "optimizer")
        with LibraryFitness(self, fitness, on_population) as evaluate:

            def of_columns(columns: Array, *_: Any) -> Any:
                return evaluate(columns.T)

            differential_evolution(
                of_columns,
                bounds=Bounds(np.zeros(d), np.ones(d)),
                init=qmc.LatinHypercube(d, seed=rng).random(self.population),
                maxiter=self.iterations,
                seed=rng,
                vectorized=True,
                updating="deferred",
                polish=False,
            )
        return evaluate.result()
