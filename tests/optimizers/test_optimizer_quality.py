"""The optimisers against the results in their papers and against those of other libraries."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from typing import Any

import minionpy
import numpy as np
import pytest
from scipy import optimize, stats

from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.optimizers import (
    DifferentialEvolution,
    Genetic,
    GreyWolf,
    Optimizer,
    ParticleSwarm,
    RandomSearch,
)
from optimizers.functions import CENTRE, box, griewank, rastrigin, rosenbrock, sphere, squares

Function = Callable[[Array], Array]


@pytest.mark.parametrize(
    ("make", "bad", "message"),
    [
        (Genetic, {"crossover_probability": 1.1}, "crossover_probability must be between 0 and 1, got 1.1"),
        (Genetic, {"crossover_index": -1.0}, "crossover_index must be at least 0 and finite, got -1"),
        (Genetic, {"mutation_index": math.inf}, "mutation_index must be at least 0 and finite, got inf"),
        (ParticleSwarm, {"cognitive": -1.0, "social": 6.0}, "cognitive must be at least 0, got -1"),
        (ParticleSwarm, {"social": math.nan}, "social must be at least 0, got nan"),
        (ParticleSwarm, {"social": 1.95}, r"cognitive \+ social must be above 4 and finite, got 4"),
        (ParticleSwarm, {"social": math.inf}, "must be above 4 and finite, got inf"),
        (DifferentialEvolution, {"population": 3}, "population must be at least 4, got 3"),
        (DifferentialEvolution, {"scale": 0.0}, "scale must be above 0 and at most 2, got 0"),
        (DifferentialEvolution, {"scale": math.nan}, "scale must be above 0 and at most 2, got nan"),
        (DifferentialEvolution, {"crossover": -0.1}, "crossover must be between 0 and 1, got -0.1"),
        (GreyWolf, {"population": 2}, "population must be at least 3, got 2"),
    ],
)
def test_invalid_settings_are_refused(make: Callable[..., Any], bad: dict[str, Any], message: str) -> None:
    with pytest.raises(MethodError, match=message):
        make(*box(2), **bad)


def evaluations_to(goal: float, optimizer: Optimizer[Any], function: Function, seed: int) -> float:
    """Return the evaluations required to reach `goal`; inf if the run ends earlier."""
    state = optimizer.init(seed)
    while not optimizer.finished(state):
        state = optimizer.tell(state, function(optimizer.ask(state)))
        if state.best_fitness <= goal:
            return float(state.evaluations)
    return math.inf


def differs(
    sample: list[float], published: float, runs: int, level: float, deviation: float | None = None
) -> bool:
    """Return whether a published mean of `runs` differs significantly from that of `sample`.

    `deviation` is the published standard deviation; without it, that of `sample` is used for both.
    """
    own = float(np.std(sample, ddof=1))
    error = math.hypot(own / len(sample) ** 0.5, (own if deviation is None else deviation) / runs**0.5)
    return bool(abs(np.mean(sample) - published) > stats.norm.isf(level / 2) * error)


# Random search


def test_the_result_of_random_search_has_its_theoretical_distribution() -> None:
    best_values = [RandomSearch(*box(2), 10, 20).minimise(sphere, seed).fitness for seed in range(200)]

    def chance_of_at_most(r_squared: Any) -> Any:
        """Return the probability of one of 200 points in a disc about the optimum, in the box to r = 0.78."""
        return 1 - (1 - np.pi * r_squared / 4) ** 200

    # A correct sample is rejected with a probability of 1 %; these seeds are fixed.
    assert stats.kstest(best_values, chance_of_at_most).pvalue > 0.01


# Genetic algorithm


def test_the_spread_of_crossover_is_as_published() -> None:
    # The bounds are too far away to cut the distribution (Deb & Agrawal 1995, eq. 4 and 5).
    genetic = Genetic(*box(1, 1e9), population=2, crossover_probability=1.0)
    mates = np.repeat([[[0.0]], [[1.0]]], 20000, axis=1)
    children = genetic._cross(mates, np.random.default_rng(1)).reshape(2, -1)
    np.testing.assert_allclose(children.sum(axis=0), 1, atol=1e-6)  # the mean of the parents; rounding of 1e9
    spread = np.abs(children[0] - children[1])
    crossed = spread[np.abs(spread - 1) > 1e-9]
    # Each gene is crossed with probability 1/2: four standard deviations of that binomial.
    assert abs(crossed.size - 10000) < 4 * math.sqrt(20000 / 4)

    def cumulative(beta: Any) -> Any:
        return np.where(beta <= 1, beta**21 / 2, 1 - 1 / (2 * np.maximum(beta, 1) ** 21))

    assert stats.kstest(crossed, cumulative).pvalue > 0.01


def test_crossover_at_a_bound_has_a_truncated_distribution() -> None:
    # Parents at 0 and 0.1 of [0, 1]: beta is at most 1 below, and at most 19 above, which is never reached.
    genetic = Genetic(np.zeros(1), np.ones(1), population=2, crossover_probability=1.0)
    mates = np.repeat([[[0.0]], [[0.1]]], 20000, axis=1)
    children = genetic._cross(mates, np.random.default_rng(2)).reshape(2, -1)
    low, high = children.min(axis=0), children.max(axis=0)
    crossed = (low != 0) | (high != 0.1)
    beta_low, beta_high = (0.05 - low[crossed]) * 20, (high[crossed] - 0.05) * 20
    assert stats.kstest(beta_low, lambda beta: np.clip(beta, 0, 1) ** 21).pvalue > 0.01
    assert np.max(beta_high) > 1.05


@pytest.mark.parametrize("gene", [0.5, 0.0, 0.02])
def test_the_spread_of_mutation_is_as_published(gene: float) -> None:
    genetic = Genetic(np.zeros(1), np.ones(1), population=2)
    children = np.full((20000, 1), gene)  # the rate is 1/d = 1
    genetic._mutate(children, np.random.default_rng(3))
    delta = children[:, 0] - gene

    def cumulative(x: Any) -> Any:
        """Return the distribution: half on each side, proportional to (1 - |delta|)^20, cut at the bound."""
        with np.errstate(invalid="ignore"):
            below = 1 - (1 - (1 + np.minimum(x, 0)) ** 21) / (1 - (1 - gene) ** 21)
        above = (1 - (1 - np.maximum(x, 0)) ** 21) / (1 - gene**21)
        return np.where(x < 0, below / 2, (1 + above) / 2)

    if gene == 0:  # half of the mutations are beyond the bound
        assert abs(np.sum(delta == 0) - 10000) < 4 * math.sqrt(20000 / 4)
        delta = delta[delta > 0]
        assert stats.kstest(delta, lambda x: 1 - (1 - x) ** 21).pvalue > 0.01
    else:
        assert stats.kstest(delta, cumulative).pvalue > 0.01


# Particle swarm


def test_the_constriction_is_the_published_factor() -> None:
    assert ParticleSwarm(*box(1)).constriction == pytest.approx(0.72984, abs=5e-6)  # Eberhart & Shi 2000


@pytest.mark.parametrize(
    ("function", "half_width", "goal", "published"),
    [
        pytest.param(squares, 100.0, 0.01, 529.65, id="sphere"),
        pytest.param(rosenbrock, 30.0, 100.0, 668.75, id="rosenbrock"),
        pytest.param(rastrigin, 5.12, 100.0, 213.45, id="rastrigin"),
    ],
)
def test_the_swarm_reaches_goals_no_later_than_published(
    function: Function, half_width: float, goal: float, published: float
) -> None:
    """Eberhart & Shi 2000, mean iterations with constriction and Vmax = Xmax.

    The swarm is faster, by a third on the sphere; the comparison with swarms of other libraries is below.
    """
    swarm = ParticleSwarm(*box(30, half_width), population=30, iterations=4000)
    needed = [evaluations_to(goal, swarm, function, seed) / 30 for seed in range(5)]
    assert np.median(needed) < published


def test_the_swarm_is_as_fast_as_published_on_griewank() -> None:
    swarm = ParticleSwarm(*box(30, 600.0), population=30, iterations=1000)
    needed = [evaluations_to(0.1, swarm, griewank, seed) / 30 for seed in range(20)]
    # The mean is not compared: one run in 20 never reaches the goal.
    assert np.min(needed) < 312.6 < np.quantile(needed, 0.75)


# Differential evolution


def evaluations_of_plain_algorithm(
    goal: float,
    settings: tuple[int, float, float],
    bounds: tuple[Array, Array],
    function: Function,
    seed: int,
) -> float:
    """Return the evaluations of DE/rand/1/bin, one vector and component at a time, without bounds."""
    (n, scale, crossover), rng = settings, np.random.default_rng(seed)
    vectors = rng.uniform(*bounds, (n, bounds[0].size)).tolist()
    costs = function(np.array(vectors)).tolist()
    for evaluations in range(n, 2000 * n + 1, n):
        if min(costs) <= goal:
            return float(evaluations)
        trials = []
        for i, x in enumerate(vectors):
            a, b, c = rng.choice([j for j in range(n) if j != i], 3, replace=False)
            sure = rng.integers(len(x))
            trials.append(
                [
                    vectors[a][k] + scale * (vectors[b][k] - vectors[c][k])
                    if k == sure or rng.random() < crossover
                    else x[k]
                    for k in range(len(x))
                ]
            )
        for i, cost in enumerate(function(np.array(trials)).tolist()):
            if cost <= costs[i]:
                vectors[i], costs[i] = trials[i], cost
    return math.inf


@pytest.mark.parametrize(
    ("function", "bounds", "settings"),
    [
        pytest.param(squares, box(3, 5.12), (10, 0.9, 0.1), id="f1"),
        pytest.param(rosenbrock, box(2, 2.048), (10, 0.9, 0.9), id="f2"),
        pytest.param(squares, box(3, 5.12), (15, 0.5, 0.9), id="f1-defaults", marks=pytest.mark.evidence),
    ],
)
def test_differential_evolution_requires_the_evaluations_of_the_plain_algorithm(
    function: Function, bounds: tuple[Array, Array], settings: tuple[int, float, float]
) -> None:
    """The measure of Storn & Price on De Jong's functions: evaluations to 1e-6. 1 % shared by three cases.

    The bounds save some 5 % of the evaluations on f1 and f2, which is not significant in 30 runs.
    """
    population, scale, crossover = settings
    optimizer = DifferentialEvolution(*bounds, population, 2000, scale=scale, crossover=crossover)
    mine = [evaluations_to(1e-6, optimizer, function, seed) for seed in range(30)]
    plain = [evaluations_of_plain_algorithm(1e-6, settings, bounds, function, seed) for seed in range(30)]
    assert stats.mannwhitneyu(mine, plain).pvalue > 0.01 / 3


@pytest.mark.parametrize("corner", [0.0, 1.0])
def test_differential_evolution_converges_to_a_corner_without_reaching_it(corner: float) -> None:
    optimizer = DifferentialEvolution(np.zeros(8), np.ones(8), population=50, iterations=200)
    best = []
    for seed in range(5):
        state = optimizer.init(seed)
        while not optimizer.finished(state):
            state = optimizer.tell(state, squares(optimizer.ask(state) - corner))
        assert not np.any(state.parents == corner)  # clipping would move all 50 there
        best.append(state.best_fitness)
    # After the same number of generations, reflection reaches 1.5e-12, random values 3e-7, this method 1e-14.
    assert np.median(best) < 3e-13


# Grey wolves


@pytest.mark.evidence
@pytest.mark.parametrize(
    ("function", "half_width", "published", "deviation", "runs"),
    [
        pytest.param(squares, 100.0, 6.59e-28, None, 8, id="F1"),
        pytest.param(rosenbrock, 30.0, 26.81258, None, 8, id="F5"),
        pytest.param(rastrigin, 5.12, 0.310521, None, 15, id="F9"),
        pytest.param(griewank, 600.0, 0.004485, 0.006659, 15, id="F11"),
    ],
)
def test_grey_wolves_reach_the_published_results(
    function: Function, half_width: float, published: float, deviation: float | None, runs: int
) -> None:
    """Mirjalili et al. 2014, Tables 5 and 6: means of 30 runs in 30 dimensions.

    Four of five runs on F11 end at 0, so that our 15 runs may hardly differ from each other: for F11 the
    published standard deviation is used. Those of the others cannot be of such runs (6e-5 for F1).

    With the best three of all points as leaders, F1 ends a thousand times lower and F9 higher: rejected.
    """
    optimizer = GreyWolf(*box(30, half_width), population=30, iterations=500)
    results = [optimizer.minimise(function, seed).fitness for seed in range(runs)]
    level = 0.01 / 4  # 1 % shared by four functions
    assert not differs(results, published, runs=30, level=level, deviation=deviation)


# Other libraries, at equal evaluations

DIMENSIONS, POPULATION, ITERATIONS = 8, 50, 40
RUNS, THEIR_RUNS = 40, 9  # the error of 15 of each: 1/40 + 1/9 = 1/15 + 1/15; other libraries are slower
CHI = 0.7298437881283576  # 2 / |2 - 4.1 - sqrt(4.1² - 4 × 4.1)|, Clerc & Kennedy 2002

FUNCTIONS: dict[str, tuple[Function, float]] = {
    "sphere": (sphere, 1.0),
    "rastrigin": (lambda points: rastrigin(points - CENTRE), 5.12),
}


def run_pymoo(algorithm: Callable[[], Any], function: Function, half_width: float, seed: int) -> float:
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Searched(Problem):  # type: ignore[misc]  # the library has no types
        def __init__(self) -> None:
            super().__init__(n_var=DIMENSIONS, n_obj=1, xl=-half_width, xu=half_width)

        def _evaluate(self, points: Array, out: dict[str, Array], *_: Any, **__: Any) -> None:
            out["F"] = function(points)[:, None]

    return float(minimize(Searched(), algorithm(), ("n_gen", ITERATIONS), seed=seed + 1).F[0])


def pymoo_genetic() -> Any:
    from pymoo.algorithms.soo.nonconvex.ga import GA
    from pymoo.operators.crossover.sbx import SBX
    from pymoo.operators.mutation.pm import PM

    crossover, mutation = SBX(prob=0.9, eta=20, prob_var=0.5), PM(prob=1.0, eta=20)
    return GA(pop_size=POPULATION, crossover=crossover, mutation=mutation, eliminate_duplicates=False)


def scipy_differential_evolution(function: Function, half_width: float, seed: int) -> float:
    def of_columns(points: Any) -> Any:
        return function(points.T)

    rng = np.random.default_rng(seed)
    result = optimize.differential_evolution(
        of_columns,
        optimize.Bounds(*box(DIMENSIONS, half_width)),
        strategy="rand1bin",
        mutation=0.5,
        recombination=0.9,
        init=rng.uniform(-half_width, half_width, (POPULATION, DIMENSIONS)),
        maxiter=ITERATIONS - 1,  # SciPy does not count the first population
        tol=0,
        updating="deferred",
        vectorized=True,
        polish=False,
        rng=rng,
    )
    return float(result.fun)


def run_minionpy(
    algorithm: Any, options: dict[str, Any], function: Function, half_width: float, seed: int
) -> float:
    search = algorithm(
        lambda points: function(np.asarray(points)).tolist(),
        [(-half_width, half_width)] * DIMENSIONS,
        maxevals=POPULATION * ITERATIONS,
        seed=seed,
        options={"population_size": POPULATION, "bound_strategy": "reflect-random"} | options,
    )
    return float(search.optimize().fun)


def niapy_wolves(function: Function, half_width: float, seed: int) -> float:
    from niapy.algorithms.basic import GreyWolfOptimizer
    from niapy.problems import Problem
    from niapy.task import Task

    class Searched(Problem):  # type: ignore[misc]  # the library has no types
        def __init__(self) -> None:
            super().__init__(DIMENSIONS, -half_width, half_width)

        def _evaluate(self, point: Array) -> float:
            return float(function(point[None])[0])

    task = Task(Searched(), max_evals=POPULATION * ITERATIONS)
    return float(GreyWolfOptimizer(population_size=POPULATION, seed=seed).run(task)[1])


RAND_1_BIN = {"mutation_strategy": "rand1bin", "mutation_rate": 0.5, "crossover_rate": 0.9}
ENDLESS = {"x_tol": -1.0, "f_tol": -1.0}
SWARM = {
    "inertia_weight": CHI,
    "cognitive_coefficient": 2.05 * CHI,
    "social_coefficient": 2.05 * CHI,
    "velocity_clamp": 0.5,
}

# Pymoo, the slowest, is used only for methods that the faster libraries lack.
PEERS: dict[str, tuple[type[Optimizer[Any]], Callable[[Function, float, int], float]]] = {
    "genetic-pymoo": (Genetic, partial(run_pymoo, pymoo_genetic)),
    "differential-evolution-scipy": (DifferentialEvolution, scipy_differential_evolution),
    "differential-evolution-minionpy": (
        DifferentialEvolution,
        partial(run_minionpy, minionpy.Differential_Evolution, RAND_1_BIN | ENDLESS),
    ),
    "particle-swarm-minionpy": (ParticleSwarm, partial(run_minionpy, minionpy.PSO, SWARM)),
    "grey-wolf-niapy": (GreyWolf, niapy_wolves),
}


@cache
def our_result(make: type[Optimizer[Any]], function: Function, half_width: float, seed: int) -> float:
    optimizer = make(*box(DIMENSIONS, half_width), POPULATION, ITERATIONS)
    state = optimizer.init(seed)
    if make is GreyWolf:
        # niapy lowers `a` before its first move, the authors' code after it: it is one iteration ahead, and
        # its pack is narrower at the end. Otherwise they must agree.
        state = replace(state, iteration=1)
    for _ in range(ITERATIONS):
        state = optimizer.tell(state, function(optimizer.ask(state)))
    return float(state.best_fitness)


@pytest.mark.evidence
@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("peer", PEERS)
def test_the_final_fitness_agrees_with_other_libraries(peer: str, name: str) -> None:
    """Two-sided Mann-Whitney test on the final fitness, at 1 % shared by all comparisons (Bonferroni).

    The optimum is inside the box, since libraries treat bounds differently. A scale of 0.6
    instead of 0.5 or c_1 = c_2 = 2.2 is rejected on the sphere against each library (p below 1e-6).
    """
    (make, theirs), (function, half_width) = PEERS[peer], FUNCTIONS[name]
    mine = [our_result(make, function, half_width, seed) for seed in range(RUNS)]
    others = [theirs(function, half_width, seed) for seed in range(THEIR_RUNS)]
    level = 0.01 / (len(PEERS) * len(FUNCTIONS))
    difference = np.mean(np.log10(mine)) - np.mean(np.log10(others))
    assert stats.mannwhitneyu(mine, others).pvalue > level, f"{difference:.2f} decades above theirs"
