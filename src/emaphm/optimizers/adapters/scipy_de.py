"""Differential evolution by SciPy."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.optimizers.adapters.driven import Driven, Evaluate


@dataclass(frozen=True, eq=False)
class ScipyDE(Driven):
    """`scipy.optimize.differential_evolution`, a whole generation in one call and without its final polish.

    All else is SciPy's default: best/1/bin with F drawn from [0.5, 1] in each generation, CR = 0.7, a Latin
    hypercube to start from, and an end where the fitness of the population spreads by less than 1 % of
    its mean.

    Parameters
    ----------
    lower, upper, iterations
        As in `Optimizer`.
    population
        Number of agents, not SciPy's multiple of the dimensions.

    Raises
    ------
    MethodError
        As in `Driven`.
    """

    method = "scipy-de"
    least_population = 5

    def _drive(self, evaluate: Evaluate, rng: np.random.Generator) -> None:
        from scipy.optimize import Bounds, differential_evolution
        from scipy.stats import qmc

        def fitness(columns: Array, *_: Any) -> Any:
            return evaluate(columns.T)

        d = self.lower.size
        differential_evolution(
            fitness,
            bounds=Bounds(np.zeros(d), np.ones(d)),
            init=qmc.LatinHypercube(d, seed=rng).random(self.population),
            maxiter=self.iterations,
            seed=rng,
            vectorized=True,
            updating="deferred",
            polish=False,
        )
