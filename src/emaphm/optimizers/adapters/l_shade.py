"""L-SHADE by the library `minionpy`."""

from dataclasses import dataclass

import numpy as np

from emaphm.optimizers.adapters.driven import Driven, Evaluate, library


@dataclass(frozen=True, eq=False)
class LShade(Driven):
    """Differential evolution that learns F and CR from its successes and shrinks its population [1].

    Settings are the library's defaults. They are those of [1] but that a component outside the bounds is
    drawn anew, not set halfway, and that a population closer together than 1e-8 of the box is an end.

    Parameters
    ----------
    lower, upper, iterations
        As in `Optimizer`.
    population
        The first; it falls linearly to 4 as the budget is spent. 18 times the dimensions in [1].

    Raises
    ------
    MethodError
        As in `Driven`.

    References
    ----------
    .. [1] R. Tanabe, A. S. Fukunaga, "Improving the search performance of SHADE using linear population
       size reduction", IEEE Congress on Evolutionary Computation, 2014.
    """

    method = "l-shade"
    least_population = 4

    def __post_init__(self) -> None:
        super().__post_init__()
        library(self.method, "minionpy")

    def _drive(self, evaluate: Evaluate, rng: np.random.Generator) -> None:
        def fitness(points: list[list[float]]) -> list[float]:
            values: list[float] = evaluate(np.array(points)).tolist()
            return values

        search = library(self.method, "minionpy.algorithms").LSHADE(
            fitness,
            bounds=[(0.0, 1.0)] * self.lower.size,
            maxevals=self.budget,
            seed=int(rng.integers(2**31)),
            options={"population_size": self.population},
        )
        try:
            search.optimize()
        finally:
            del search.optimizer  # a cycle through compiled code, which is never collected
