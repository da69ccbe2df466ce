"""Optimisers of other libraries: the contract of `Minimiser`, and agreement with each library alone."""

import gc
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emaphm.arrays import Array
from emaphm.errors import MethodError, SignalError
from emaphm.optimizers import BestSoFar, Fitness, Minimiser, OnPopulation, Result
from emaphm.optimizers.adapters import PEERS, is_peer, peer
from emaphm.optimizers.adapters.library_fitness import FAR, LibraryFitness
from emaphm.optimizers.adapters.pymoo_algorithms import PREFIX, pymoo_algorithms
from emaphm.random_streams import child_seed, stream
from optimizers import functions
from optimizers.functions import CENTRE, rosenbrock, sphere

Make = Callable[..., Minimiser]

NAMES = (*PEERS, "pymoo-ga", "pymoo-de", "pymoo-pso")


def made(name: str, **settings: Any) -> Minimiser:
    return peer(name)(**settings)


every_peer = pytest.mark.parametrize("make", [partial(made, name) for name in NAMES], ids=NAMES)


def box(dimensions: int) -> dict[str, Array]:
    return dict(zip(("lower", "upper"), functions.box(dimensions, 2.0), strict=True))


class Recorded:
    """A fitness that records the points and values of each call."""

    def __init__(self, fitness: Callable[[Array], Array] = sphere) -> None:
        self.fitness = fitness
        self.points: list[Array] = []
        self.values: list[Array] = []

    def __call__(self, points: Array) -> Array:
        """Return the values."""
        self.points.append(points.copy())
        self.values.append(self.fitness(points))
        return self.values[-1]

    @property
    def sizes(self) -> list[int]:
        """Number of points of each call."""
        return [len(points) for points in self.points]


def points_of(optimizer: Minimiser, seed: int, fitness: Callable[[Array], Array] = sphere) -> Array:
    """Return all points of a search, in order."""
    recorded = Recorded(fitness)
    optimizer.minimise(recorded, seed)
    return np.concatenate(recorded.points)


@every_peer
def test_the_seed_determines_the_bits(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=6)
    thawed = pickle.loads(pickle.dumps(optimizer))  # noqa: S301 - our own bytes
    first = points_of(optimizer, 7)
    np.testing.assert_array_equal(first, points_of(optimizer, 7))
    np.testing.assert_array_equal(first, points_of(thawed, 7))
    assert not np.array_equal(first, points_of(optimizer, 8))


@every_peer
def test_a_fitness_may_overwrite_its_points(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=4)

    def overwrites(points: Array) -> Array:
        values = sphere(points)
        points[:] = 0.0
        return values

    with_overwriting, without_overwriting = optimizer.minimise(overwrites, 3), optimizer.minimise(sphere, 3)
    np.testing.assert_array_equal(with_overwriting.point, without_overwriting.point)
    np.testing.assert_array_equal(with_overwriting.history, without_overwriting.history)


@every_peer
@settings(max_examples=3, deadline=None)
@given(
    lower=st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=5),
    width=st.floats(1e-3, 1e3),
    population=st.integers(5, 12),
    seed=st.integers(0, 2**40),
)
def test_points_stay_within_bounds(
    make: Make, lower: list[float], width: float, population: int, seed: int
) -> None:
    low = np.array(lower)
    optimizer = make(lower=low, upper=low + width, population=population, iterations=6)
    points = points_of(optimizer, seed, lambda points: -sphere(points))  # drives the search to the corners
    assert points.shape == (len(points), low.size)
    assert np.all((points >= low) & (points <= low + width))
    assert population <= len(points) <= optimizer.budget


@every_peer
def test_the_result_is_the_best_point_and_each_population_is_reported(make: Make) -> None:
    optimizer = make(**box(3), population=10, iterations=6)
    recorded, reports = Recorded(), list[BestSoFar]()
    result = optimizer.minimise(recorded, seed=1, on_population=reports.append)
    values, points = np.concatenate(recorded.values), np.concatenate(recorded.points)
    best = np.argmin(values)
    assert result.fitness == values[best]
    np.testing.assert_array_equal(result.point, points[best])
    history = np.minimum.accumulate([np.min(v) for v in recorded.values])
    np.testing.assert_array_equal(result.history, history)
    assert result.evaluations == values.size <= optimizer.budget == 60
    assert [best.evaluations for best in reports] == np.cumsum(recorded.sizes).tolist()
    np.testing.assert_array_equal([best.best_fitness for best in reports], history)
    for report in reports:
        assert sphere(report.best_point[np.newaxis])[0] == report.best_fitness


def assert_beats_random_search(optimizer: Minimiser, fitness: Callable[[Array], Array], share: float) -> None:
    reached = [optimizer.minimise(fitness, seed).fitness for seed in range(3)]
    rng, shape = np.random.default_rng(0), (optimizer.budget, optimizer.lower.size)
    at_random = [np.min(fitness(rng.uniform(optimizer.lower, optimizer.upper, shape))) for _ in range(15)]
    assert np.median(reached) < share * np.median(at_random)


@every_peer
def test_beats_random_search_on_a_sphere(make: Make) -> None:
    # A converging search gains many decades; the genetic algorithm, the slowest, gains four.
    assert_beats_random_search(make(**box(3), population=20, iterations=40), sphere, 1e-2)


@pytest.mark.evidence
@pytest.mark.parametrize("name", PEERS)
def test_beats_random_search_in_a_bent_valley(name: str) -> None:
    # Algorithms of pymoo are slow here; they are compared with pymoo alone below. These three gain
    # five decades or more.
    assert_beats_random_search(peer(name)(**box(4), population=50, iterations=100), rosenbrock, 1e-4)


@every_peer
def test_nan_fitness_is_the_worst_fitness(make: Make) -> None:
    optimizer = make(**box(2), population=20, iterations=5)

    def partly_nan(points: Array) -> Array:
        return np.where(points[:, 0] < 0, np.nan, sphere(points))

    def infinite(points: Array) -> Array:
        return np.nan_to_num(partly_nan(points), nan=np.inf)

    np.testing.assert_array_equal(points_of(optimizer, 0, partly_nan), points_of(optimizer, 0, infinite))
    result = optimizer.minimise(partly_nan, 0)
    assert result.point[0] >= 0
    assert result.fitness == sphere(result.point[np.newaxis])[0]


@every_peer
def test_a_fitness_that_is_nan_everywhere_gives_an_infinite_result(make: Make) -> None:
    optimizer = make(**box(2), population=6, iterations=4)
    result = optimizer.minimise(lambda points: np.full(len(points), np.nan), seed=0)
    assert result.fitness == np.inf
    assert np.all(np.abs(result.point) <= 2)


@every_peer
@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"lower": [0, 2]}, r"lower bound \(2\) of component 1 must be less than upper bound \(1\)"),
        ({"upper": [1, np.inf]}, "bounds of component 1 must be finite, got 0 and inf"),
        ({"population": 1}, r"population must be at least \d, got 1"),
        ({"iterations": 0}, "iterations must be at least 1, got 0"),
    ],
)
def test_invalid_settings_are_refused(make: Make, bad: dict[str, Any], message: str) -> None:
    with pytest.raises(MethodError, match=message):
        make(**({"lower": np.zeros(2), "upper": np.ones(2)} | bad))


@every_peer
def test_a_wrong_shape_of_fitness_and_a_negative_seed_are_refused(make: Make) -> None:
    optimizer = make(**box(2), population=5)
    with pytest.raises(MethodError, match=r"shape \(1,\), expected \(5,\)"):
        optimizer.minimise(lambda points: np.zeros(len(points) - 4), 0)
    with pytest.raises(SignalError, match="seed -1 is negative"):
        optimizer.minimise(sphere, -1)


@every_peer
@pytest.mark.parametrize("error", [ValueError("bad point"), KeyError("x"), KeyboardInterrupt()])
def test_errors_of_fitness_and_callback_reach_the_caller_unchanged(make: Make, error: BaseException) -> None:
    optimizer = make(**box(2), population=5, iterations=9)

    def fails(_: object) -> Any:
        raise error

    with pytest.raises(type(error)) as caught:
        optimizer.minimise(fails, 0)
    assert caught.value is error
    with pytest.raises(type(error)) as caught:
        optimizer.minimise(sphere, 0, on_population=fails)
    assert caught.value is error
    assert optimizer.minimise(sphere, 0).evaluations > 5  # no lock remains


@pytest.mark.parametrize("name", [name for name in NAMES if name != "cma-es"])
def test_one_component_can_be_searched(name: str) -> None:
    result = peer(name)(**box(1), population=10, iterations=30).minimise(sphere, 0)
    assert abs(result.point[0] - CENTRE) < 4 / 300  # as close as a grid with the same number of points


def test_cma_es_refuses_one_component() -> None:
    with pytest.raises(MethodError, match="'cma-es' needs at least 2 components to search in, got 1"):
        peer("cma-es")(**box(1))


@pytest.mark.parametrize(
    ("name", "population", "message"),
    [
        ("l-shade", 3, "population must be at least 4, got 3"),
        ("scipy-de", 4, "population must be at least 5, got 4"),
    ],
)
def test_populations_too_small_for_the_library_are_refused(name: str, population: int, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        peer(name)(**box(2), population=population)
    assert peer(name)(**box(2), population=population + 1, iterations=9).minimise(sphere, 0).evaluations > 0


@pytest.mark.parametrize("name", [*NAMES, "pymoo-cmaes"])
def test_global_random_numbers_are_not_changed(name: str) -> None:
    def global_numbers() -> list[Any]:
        return [np.array(part).tolist() for part in np.random.get_state()]  # noqa: NPY002 - the tested state

    optimizer = peer(name)(**box(2), population=10, iterations=4)
    undisturbed = optimizer.minimise(sphere, 0)
    before = global_numbers()

    def draws(points: Array) -> Array:
        nonlocal before
        assert global_numbers() == before
        np.random.random()  # noqa: NPY002 - a draw by the fitness must not affect the search
        before = global_numbers()
        return sphere(points)

    disturbed = optimizer.minimise(draws, 0)
    assert global_numbers() == before
    np.testing.assert_array_equal(undisturbed.point, disturbed.point)


@pytest.mark.parametrize("name", [*NAMES, "pymoo-cmaes"])
def test_searches_in_threads_are_independent(name: str) -> None:
    optimizer = peer(name)(**box(3), population=10, iterations=4)
    alone = [points_of(optimizer, seed) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        threaded = list(pool.map(partial(points_of, optimizer), range(4)))
    for points, threaded_points in zip(alone, threaded, strict=True):
        np.testing.assert_array_equal(points, threaded_points)


@pytest.mark.parametrize("name", ["cma-es", "scipy-de", "pymoo-ga", "pymoo-cmaes"])
def test_a_search_within_a_fitness_does_not_affect_the_outer_one(name: str) -> None:
    optimizer = peer(name)(**box(3), population=10, iterations=4)
    outer, inner = points_of(optimizer, 0), points_of(optimizer, 1)

    def searches(points: Array) -> Array:
        np.testing.assert_array_equal(points_of(optimizer, 1), inner)
        return sphere(points)

    np.testing.assert_array_equal(points_of(optimizer, 0, searches), outer)


def test_exceptions_through_compiled_code_do_not_affect_later_searches() -> None:
    optimizer = peer("l-shade")(**box(3), population=10, iterations=20)
    for seed in range(60):
        remaining_calls = seed % 7

        def stops(points: Array) -> Array:
            nonlocal remaining_calls
            remaining_calls -= 1
            if remaining_calls < 0:
                raise StopAsyncIteration
            return sphere(points)

        with pytest.raises(StopAsyncIteration):
            optimizer.minimise(stops, seed)
    # The fitness of the best of 200 random points has a median of (ln 2 · 64/200 · 3/4π)^(2/3) = 0.14.
    assert optimizer.minimise(sphere, 0).fitness < 0.014


@pytest.fixture
def new_objects() -> Callable[[], list[Any]]:
    """Return a function that lists the objects created since, without garbage; all would take long."""

    def listed() -> list[Any]:
        gc.collect()
        return gc.get_objects()

    gc.freeze()
    return listed


def test_l_shade_releases_its_memory(new_objects: Callable[[], list[Any]]) -> None:
    from minionpy.algorithms import LSHADE

    def remaining() -> int:
        return sum(type(instance) is LSHADE for instance in new_objects())

    optimizer = peer("l-shade")(**box(3), population=10, iterations=5)
    references = [LSHADE(lambda rows: [0.0] * len(rows), [(0.0, 1.0)] * 3)]
    assert remaining() == len(references)  # referenced objects are counted
    optimizer.minimise(sphere, 0)
    with pytest.raises(MethodError):
        optimizer.minimise(lambda _: 0.0, 1)
    assert remaining() == len(references)


def test_no_library_is_imported_before_use() -> None:
    script = """
import sys
import emaphm, emaphm.optimizers.adapters
assert not {"cma", "minionpy", "pymoo"} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)  # noqa: S603
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("name", "library"),
    [("cma-es", "cma"), ("l-shade", "minionpy"), ("pymoo-ga", "pymoo")],
)
def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch, name: str, library: str) -> None:
    frozen = pickle.dumps(peer(name)(**box(2), population=10))
    monkeypatch.setitem(sys.modules, library, None)  # makes its import fail
    message = f"method '{name}' needs the library '{library}'; install it with: pip install 'emaphm[peers]'"
    with pytest.raises(MethodError) as caught:
        peer(name)(**box(2), population=10)
    assert str(caught.value) == message
    thawed = pickle.loads(frozen)  # noqa: S301 - our own bytes, read on a computer without the library
    with pytest.raises(MethodError) as caught:
        thawed.minimise(sphere, 0)
    assert str(caught.value) == message


def test_a_broken_library_is_not_reported_as_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in [name for name in sys.modules if name == "cma" or name.startswith("cma.")]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "cma.sampler", None)
    with pytest.raises(ImportError, match=r"cma\.sampler"):
        peer("cma-es")(**box(2))


def test_all_named_methods_run_and_repeat_or_are_refused() -> None:
    usable, refused = set(), []
    for name in (*PEERS, *(PREFIX + algorithm for algorithm in pymoo_algorithms())):
        assert is_peer(name)
        try:
            optimizer = peer(name)(**box(8), population=50, iterations=4)
        except MethodError as error:
            refused.append(str(error))
            continue
        usable.add(name)
        first, second = (optimizer.minimise(sphere, seed) for seed in (5, 5))
        assert first.fitness < 4, name  # random points have a mean of 8 (4/3 + 0.2134²) = 11
        np.testing.assert_array_equal(first.history, second.history, name)
        assert first.evaluations <= 200, name
    assert set(NAMES) | {"pymoo-cmaes", "pymoo-nelder-mead", "pymoo-es"} <= usable
    assert all("cannot be used" in message for message in refused)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cma", r"unknown method 'cma' \(did you mean 'cma-es'\?\)"),
        ("pymoo-gaa", r"unknown method 'pymoo-gaa' \(did you mean 'pymoo-ga'\?\)"),
        ("pymoo-nelder", r"did you mean 'pymoo-nelder-mead'\?"),
    ],
)
def test_misspelt_names_are_refused_with_the_nearest(name: str, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        peer(name)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("pymoo-bga", "method 'pymoo-bga' cannot be used: it does not search real numbers; choose another"),
        ("pymoo-brkga", "method 'pymoo-brkga' cannot be used: with population 50 pymoo says '.*pop_size"),
        ("pymoo-pattern-search", "cannot be used: pymoo's search is not repeatable from a seed"),
    ],
)
def test_unsuitable_algorithms_are_refused(name: str, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        peer(name)(**box(3))


def test_unknown_settings_are_refused() -> None:
    with pytest.raises(TypeError):
        peer("pymoo-ga")(**box(2), algorithm="de")


def test_the_population_of_l_shade_shrinks_as_published() -> None:
    optimizer = peer("l-shade")(**box(8), population=144, iterations=50)
    recorded = Recorded(rosenbrock)
    optimizer.minimise(recorded, seed=0)
    sizes = recorded.sizes
    evaluated = np.cumsum(sizes)
    # Tanabe & Fukunaga (2014), equation 10, from the evaluations before each generation. The library
    # rounds down where the paper rounds to the nearest.
    published = (4 - 144) / optimizer.budget * evaluated[:-2] + 144
    assert sizes[0] == 144
    assert np.all(np.abs(sizes[1:-1] - published) <= 1)
    assert sizes[-2] <= 5
    assert evaluated[-1] == optimizer.budget


def test_cma_es_starts_in_the_middle_and_restarts_with_twice_the_population() -> None:
    optimizer = peer("cma-es")(**box(3), population=10, iterations=400)
    recorded = Recorded()
    result = optimizer.minimise(recorded, seed=0)
    # Standard error of the mean of 10 points is 0.25 * 4 / sqrt(10) = 0.32; three of them.
    assert np.all(np.abs(recorded.points[0].mean(axis=0)) < 0.96)
    sizes = recorded.sizes
    assert set(sizes[:-1]) >= {10, 20, 40}
    assert sizes[:-1] == sorted(sizes[:-1])
    assert all(size in 10 * 2 ** np.arange(9) for size in sizes[:-1])
    assert result.evaluations == optimizer.budget


def test_the_adapter_of_scipy_agrees_with_scipy_alone() -> None:
    from scipy.optimize import Bounds, differential_evolution
    from scipy.stats import qmc

    adapted = peer("scipy-de")(**box(3), population=30, iterations=41).minimise(rosenbrock, seed=6)
    rng = stream(6, "optimizer")
    start = qmc.LatinHypercube(3, seed=rng).random(30) * 4 - 2

    def fitness(columns: Array, *_: Any) -> Any:
        return rosenbrock(columns.T)

    alone = differential_evolution(
        fitness, bounds=Bounds([-2.0] * 3, [2.0] * 3), init=start, maxiter=40, seed=rng,
        vectorized=True, updating="deferred", polish=False,
    )  # fmt: skip
    assert adapted.fitness == pytest.approx(
        alone.fun, rel=1e-6
    )  # both have rounding in the scaling from the unit cube
    np.testing.assert_allclose(adapted.point, alone.x, rtol=1e-6)


@pytest.mark.parametrize("name", ["ga", "de", "pso"])
def test_the_adapter_of_pymoo_agrees_with_pymoo_alone(name: str) -> None:
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    from emaphm.optimizers.adapters.pymoo_algorithms import pymoo_algorithms

    class Valley(Problem):  # type: ignore[misc]
        def _evaluate(self, x: Array, out: dict[str, Array], *_: object) -> None:
            out["F"] = rosenbrock(x)

    adapted = peer(f"pymoo-{name}")(**box(3), population=20, iterations=15).minimise(rosenbrock, seed=6)
    alone = minimize(
        Valley(n_var=3, xl=-2.0, xu=2.0),
        pymoo_algorithms()[name](pop_size=20),
        ("n_eval", 300),
        seed=child_seed(6, "optimizer"),
    )
    assert adapted.fitness == pytest.approx(alone.F[0], rel=1e-6)
    np.testing.assert_allclose(adapted.point, alone.X, rtol=1e-6)


def test_the_adapter_of_l_shade_agrees_with_the_library_alone() -> None:
    from minionpy.algorithms import LSHADE

    adapted = peer("l-shade")(**box(3), population=20, iterations=60).minimise(rosenbrock, seed=6)
    alone = LSHADE(
        lambda rows: rosenbrock(np.array(rows) * 4 - 2).tolist(),
        [(0.0, 1.0)] * 3, maxevals=1200, seed=child_seed(6, "optimizer"),
        options={"population_size": 20},
    ).optimize()  # fmt: skip
    # The last generation of the library may exceed the budget, while that of the adapter is cut.
    assert adapted.fitness == pytest.approx(alone.fun, rel=1e-6)


def test_the_adapter_of_cma_es_agrees_with_the_library_alone() -> None:
    import cma

    adapted = peer("cma-es")(**box(3), population=10, iterations=30).minimise(rosenbrock, seed=6)
    rng = stream(6, "optimizer")
    options = {
        "bounds": [0, 1], "popsize": 10, "maxfevals": 299, "seed": np.nan, "verbose": -9,
        "randn": lambda *shape: rng.standard_normal(shape),
    }  # fmt: skip
    search = cma.CMAEvolutionStrategy([0.5] * 3, 0.25, options)
    alone = search.optimize(lambda x: rosenbrock(x[np.newaxis] * 4 - 2)[0]).result
    assert adapted.evaluations == alone.evaluations == 300
    assert adapted.fitness == pytest.approx(alone.fbest, rel=1e-6)
    np.testing.assert_allclose(adapted.point, alone.xbest * 4 - 2, rtol=1e-6)


Loop = Callable[[LibraryFitness, np.random.Generator], object]


@dataclass(frozen=True, eq=False)
class Scripted(Minimiser):
    """An adapter of a library whose loop is given by the test."""

    loop: Loop = print

    def minimise(self, fitness: Fitness, seed: int, on_population: OnPopulation | None = None) -> Result:
        """Run the loop."""
        with LibraryFitness(self, fitness, on_population) as evaluate:
            self.loop(evaluate, stream(seed, "optimizer"))
        return evaluate.result()


def scripted(loop: Loop, **budget: int) -> Scripted:
    budget = {"population": 4, "iterations": 5} | budget
    return Scripted(**box(2), **budget, loop=loop)  # type: ignore[arg-type]


def test_errors_of_the_library_are_raised() -> None:
    def fails(evaluate: LibraryFitness, rng: np.random.Generator) -> None:
        evaluate(rng.random((4, 2)))
        raise ZeroDivisionError("the library's own")

    with pytest.raises(ZeroDivisionError, match="the library's own"):
        scripted(fails).minimise(sphere, 0)


@pytest.mark.parametrize("swallowed", [Exception, BaseException])
def test_a_library_that_swallows_or_replaces_exceptions_is_stopped(swallowed: type[BaseException]) -> None:
    def stubborn(evaluate: LibraryFitness, rng: np.random.Generator) -> None:
        for _ in range(9):
            try:
                evaluate(rng.random((4, 2)))
            except swallowed:
                continue
        raise ValueError("as a library turns one error into another")

    recorded = Recorded()
    assert scripted(stubborn, iterations=2).minimise(recorded, 0).evaluations == 8
    assert recorded.sizes == [4, 4]
    failing = Recorded(lambda _: np.array(1 // 0))
    with pytest.raises(ZeroDivisionError):
        scripted(stubborn).minimise(failing, 0)
    assert failing.sizes == [4]


def test_a_library_may_end_before_the_budget() -> None:
    result = scripted(lambda evaluate, rng: [evaluate(rng.random((3, 2))) for _ in range(2)]).minimise(
        sphere, 0
    )
    assert (result.evaluations, result.history.size) == (6, 2)


def test_a_library_without_evaluations_returns_the_middle_of_the_box() -> None:
    result = scripted(lambda evaluate, _: evaluate(np.empty((0, 2)))).minimise(sphere, 0)
    assert (result.evaluations, result.fitness) == (0, np.inf)
    np.testing.assert_array_equal(result.point, [0, 0])


def test_the_budget_cuts_the_last_population_and_ends_the_library() -> None:
    received: list[int] = []

    def grows(evaluate: LibraryFitness, rng: np.random.Generator) -> None:
        received.extend(len(evaluate(rng.random((size, 2)))) for size in range(1, 100))

    optimizer, recorded = scripted(grows), Recorded()
    result = optimizer.minimise(recorded, 0)
    assert recorded.sizes == [1, 2, 3, 4, 5, 5]
    assert result.evaluations == optimizer.budget == 20
    assert result.fitness == np.min(np.concatenate(recorded.values))
    assert received == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("least", [-np.inf, 2.5])
def test_the_library_receives_a_finite_fitness_and_the_caller_the_exact_one(least: float) -> None:
    received: list[Array] = []
    optimizer = scripted(lambda evaluate, rng: received.append(evaluate(rng.random((4, 2)))))
    result = optimizer.minimise(lambda _: [np.nan, np.inf, least, 2.5], 0)
    np.testing.assert_array_equal(received, [[FAR, FAR, max(least, -FAR), 2.5]])
    assert result.fitness == least
    assert np.isfinite(np.std([FAR, -FAR]))  # even for libraries that square the fitness


def test_only_floating_point_warnings_of_the_library_are_hidden() -> None:
    def overflows(evaluate: LibraryFitness, rng: np.random.Generator) -> None:
        assert np.isinf(np.exp(1e3 * (2 + evaluate(rng.random((4, 2)))))).all()

    scripted(overflows).minimise(sphere, 0)  # warnings are errors in these tests
    with pytest.warns(RuntimeWarning, match="overflow"):
        scripted(overflows).minimise(lambda points: np.exp(1e3 * (2 + sphere(points))), 0)
    with pytest.warns(RuntimeWarning, match="overflow"):
        np.exp(np.array([1e3]))


@pytest.mark.parametrize("outside", [1.001, -0.001, np.nan])
def test_a_library_that_leaves_the_bounds_is_stopped(outside: float) -> None:
    with pytest.raises(MethodError, match="points outside the bounds"):
        scripted(lambda evaluate, _: evaluate(np.array([[0.5, outside]]))).minimise(sphere, 0)


def test_points_beyond_the_bounds_by_rounding_are_clipped() -> None:
    points = points_of(scripted(lambda evaluate, _: evaluate(np.array([[1 + 1e-15, -1e-15]]))), 0)
    np.testing.assert_array_equal(points, [[2, -2]])
