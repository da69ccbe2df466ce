"""Overhead of an optimiser without the simulator, per generation of 50 agents in 8 dimensions, one core.

All use the same trivial fitness, so that only the optimiser is measured. Run by `make bench`.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from bench.conftest import Report
from emaphm.arrays import Array
from emaphm.optimizers import OPTIMIZERS

if TYPE_CHECKING:
    from collections.abc import Callable

AGENTS, DIMENSIONS, GENERATIONS = 50, 8, 100

BUDGET_S = 2e-4
"""Time per generation: a tenth of that of its 50 simulations."""


def fitness(points: Array) -> Array:
    """Return one component of each point: almost no work, and no ties."""
    return points[:, 0]


@pytest.mark.parametrize("name", OPTIMIZERS)
def test_ours(benchmark: Any, report: Report, name: str) -> None:
    make = OPTIMIZERS[name]
    optimizer = make(np.zeros(DIMENSIONS), np.ones(DIMENSIONS), AGENTS, GENERATIONS)
    benchmark(optimizer.minimise, fitness, 0)
    report(
        f"{name}, one generation",
        budget="≥ 1 ×",
        runs=GENERATIONS,
        reference=BUDGET_S,
        against="0.2 ms",
    )


@pytest.mark.parametrize("name", ["ga", "de", "pso"])
def test_pymoo(benchmark: Any, report: Report, name: str) -> None:
    from importlib import import_module

    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Trivial(Problem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=DIMENSIONS, n_obj=1, xl=0.0, xu=1.0)

        def _evaluate(self, x: Array, out: dict[str, Array], *_: Any, **__: Any) -> None:
            out["F"] = fitness(x)

    kind = getattr(import_module(f"pymoo.algorithms.soo.nonconvex.{name}"), name.upper())
    benchmark(lambda: minimize(Trivial(), kind(pop_size=AGENTS), ("n_gen", GENERATIONS), seed=0))
    _note(report, f"pymoo's {name.upper()}, one generation")


def test_scipy(benchmark: Any, report: Report) -> None:
    from scipy.optimize import differential_evolution

    start = np.random.default_rng(0).random((AGENTS, DIMENSIONS))
    minimize: Any = differential_evolution  # its types lack `vectorized`
    benchmark(
        lambda: minimize(
            lambda x: fitness(x.T),
            [(0.0, 1.0)] * DIMENSIONS,
            maxiter=GENERATIONS - 1,
            init=start,
            tol=0,
            vectorized=True,
            updating="deferred",
            polish=False,
            rng=0,
        )
    )
    _note(report, "scipy's differential evolution, one generation")


@pytest.mark.parametrize(
    ("module", "kind"),
    [
        ("ga", "GeneticAlgorithm"),
        ("de", "DifferentialEvolution"),
        ("pso", "ParticleSwarmOptimization"),
        ("gwo", "GreyWolfOptimizer"),
    ],
    ids=["ga", "de", "pso", "gwo"],
)
def test_niapy(benchmark: Any, report: Report, module: str, kind: str) -> None:
    from importlib import import_module

    from niapy.problems import Problem
    from niapy.task import Task

    class Trivial(Problem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(dimension=DIMENSIONS, lower=0.0, upper=1.0)

        def _evaluate(self, x: Array) -> float:
            return float(x[0])

    algorithm: Callable[..., Any] = getattr(import_module(f"niapy.algorithms.basic.{module}"), kind)
    benchmark(
        lambda: algorithm(population_size=AGENTS, seed=0).run(Task(problem=Trivial(), max_iters=GENERATIONS))
    )
    _note(report, f"niapy's {kind}, one generation")


def _note(report: Report, what: str) -> None:
    report(what, budget="-", runs=GENERATIONS, reference=BUDGET_S, against="0.2 ms")
