"""Bounded damped least squares against SciPy, on models in closed form."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import least_squares as scipy_least_squares

from cases import THESIS
from emaphm.arrays import Array
from emaphm.estimation.finite_differences import one_sided_jacobians
from emaphm.estimation.levenberg_marquardt import LeastSquaresSettings, least_squares
from emaphm.estimation.space.parameter_space import Box, ParameterSpace

Simulate = Callable[[Array], Array]

TIME = np.linspace(0.0, 3.0, 80)
BOX = Box(np.array([0.2, 0.1, -1.0]), np.array([5.0, 4.0, 1.0]))
INSIDE = arrays(np.float64, 3, elements=st.floats(0, 1)).map(
    lambda u: BOX.lower + u * (BOX.upper - BOX.lower)
)
TIGHT = 1e-12
"""Tolerance of the descent, so small that the derivatives limit the accuracy of its end."""


def decay(points: Array) -> Array:
    """Return a exp(-b t) + c at `TIME` for points (n, 3) of (a, b, c)."""
    a, b, c = points.T[:, :, np.newaxis]
    return np.asarray(a * np.exp(-b * TIME) + c)


def decay_with_trend(seed: int) -> Array:
    """Return a decay with noise and with a trend that the model lacks."""
    rng = np.random.default_rng(seed)
    return np.asarray(decay(np.array([[2.0, 1.3, 0.4]]))[0] + 0.05 * TIME + rng.normal(0, 0.02, TIME.size))


def reference(simulate: Simulate, recorded: Array, start: Array, box: Box) -> tuple[Array, float]:
    """Return the solution of SciPy and its mean squared residual."""
    inner = np.clip(
        start, box.lower + 1e-6, box.upper - 1e-6
    )  # SciPy requires a start strictly inside the bounds

    def misfit(point: Array) -> Array:
        return np.asarray(simulate(point[np.newaxis])[0] - recorded)

    solution = scipy_least_squares(
        misfit,
        inner,
        bounds=(box.lower, box.upper),
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    return np.asarray(solution.x), float(np.mean(solution.fun**2))


STARTS = np.array([[1.0, 1.0, 0.0], [4.5, 0.3, -0.8], [0.4, 3.5, 0.9], [3.0, 3.0, 0.5]])


def test_every_start_ends_at_the_solution_of_scipy() -> None:
    recorded = decay_with_trend(0)
    best, least = reference(decay, recorded, STARTS[0], BOX)
    solution = least_squares(
        decay, recorded, STARTS, BOX, LeastSquaresSettings(iterations=60, least_gain=TIGHT)
    )
    # One-sided differences over 2e-3 change the normal equations by some 1e-3 of a small residual.
    np.testing.assert_allclose(solution.points, np.tile(best, (4, 1)), rtol=0, atol=1e-3)
    np.testing.assert_allclose(solution.costs, least, rtol=1e-5)
    np.testing.assert_array_equal(solution.best, solution.points[solution.costs.argmin()])


@pytest.mark.parametrize(("component", "bound"), [(0, 1.5), (1, 1.0), (2, 0.2)])
def test_an_active_bound_is_met_at_the_solution(component: int, bound: float) -> None:
    recorded = decay_with_trend(1)
    upper = BOX.upper.copy()
    upper[component] = bound
    box = Box(BOX.lower, upper)
    best, least = reference(decay, recorded, np.array([1.0, 0.5, 0.0]), box)
    assert best[component] == pytest.approx(bound, abs=1e-6)
    solution = least_squares(
        decay, recorded, STARTS, box, LeastSquaresSettings(iterations=100, least_gain=TIGHT)
    )
    assert np.all(solution.points[:, component] == bound)
    np.testing.assert_allclose(solution.best, best, rtol=0, atol=2e-3)
    np.testing.assert_allclose(solution.costs, least, rtol=1e-4)


def test_a_component_without_effect_does_not_affect_the_others() -> None:
    recorded = decay_with_trend(2)
    best, _ = reference(decay, recorded, STARTS[0], BOX)
    wider = Box(np.append(BOX.lower, 0.0), np.append(BOX.upper, 1.0))
    starts = np.column_stack([STARTS, [0.0, 0.3, 0.7, 1.0]])
    solution = least_squares(
        lambda p: decay(p[:, :3]),
        recorded,
        starts,
        wider,
        LeastSquaresSettings(iterations=60, least_gain=TIGHT),
    )
    np.testing.assert_allclose(solution.points[:, :3], np.tile(best, (4, 1)), rtol=0, atol=1e-3)
    # Only rounding, some 1e-9 of the other derivatives, moves this component.
    np.testing.assert_allclose(solution.points[:, 3], starts[:, 3], rtol=0, atol=1e-4)


def test_without_any_effect_the_starts_are_returned() -> None:
    recorded = decay_with_trend(2)
    solution = least_squares(lambda p: np.zeros((len(p), TIME.size)), recorded, STARTS, BOX)
    np.testing.assert_array_equal(solution.points, STARTS)
    np.testing.assert_allclose(solution.costs, np.mean(recorded**2))


def test_a_start_at_the_solution_does_not_move() -> None:
    truth = np.array([[2.0, 1.3, 0.4]])
    solution = least_squares(decay, decay(truth)[0], truth, BOX)
    np.testing.assert_array_equal(solution.points, truth)
    assert solution.costs[0] == 0


@pytest.mark.parametrize("iterations", [1, 2])
def test_a_linear_problem_converges_by_the_damping_in_each_iteration(iterations: int) -> None:
    rng = np.random.default_rng(3)
    matrix, truth = rng.normal(size=(3, 80)), np.array([1.0, 2.0, -0.3])
    solution = least_squares(
        lambda p: p @ matrix,
        truth @ matrix,
        STARTS[:1],
        BOX,
        LeastSquaresSettings(iterations=iterations, least_gain=TIGHT),
    )
    # The damping is 1e-3 of the diagonal, then 1e-4 of it. Each iteration leaves some two times this share of
    # the error (the equations are well conditioned), and the square of it of the cost.
    before = np.mean(((truth - STARTS[0]) @ matrix) ** 2)
    assert solution.costs[0] <= before * {1: 3e-3, 2: 3e-7}[iterations] ** 2


@given(start=INSIDE, seed=st.integers(0, 5), iterations=st.integers(0, 8))
def test_the_descent_never_increases_the_cost_and_stays_within_bounds(
    start: Array, seed: int, iterations: int
) -> None:
    recorded, evaluated = decay_with_trend(seed), []

    def simulate(points: Array) -> Array:
        evaluated.append(points.copy())
        return decay(points)

    starts = start[np.newaxis]
    solution = least_squares(simulate, recorded, starts, BOX, LeastSquaresSettings(iterations=iterations))
    np.testing.assert_array_equal(starts[0], start)
    all_points = np.concatenate(evaluated)
    assert np.all((all_points >= BOX.lower) & (all_points <= BOX.upper))
    assert solution.costs[0] <= np.mean((recorded - decay(starts)[0]) ** 2)
    assert solution.costs[0] == np.mean((recorded - decay(solution.points)[0]) ** 2)


def test_a_start_outside_the_box_is_projected_onto_it() -> None:
    solution = least_squares(
        decay, decay_with_trend(0), np.array([[9.0, -3.0, 0.0]]), BOX, LeastSquaresSettings(iterations=0)
    )
    np.testing.assert_array_equal(solution.points, [[5.0, 0.1, 0.0]])


def test_each_start_is_independent_of_the_others() -> None:
    recorded = decay_with_trend(4)
    batch = least_squares(decay, recorded, STARTS, BOX)
    for i, start in enumerate(STARTS):
        alone = least_squares(decay, recorded, start[np.newaxis], BOX)
        np.testing.assert_array_equal(alone.points[0], batch.points[i])


def test_iterations_are_reported() -> None:
    done: list[int] = []
    least_squares(
        decay,
        decay_with_trend(0),
        STARTS,
        BOX,
        LeastSquaresSettings(iterations=3, least_gain=0.0),
        done.append,
    )
    assert done == [1, 2, 3]


def test_one_sided_derivatives_agree_with_the_closed_form() -> None:
    points = np.array([[2.0, 1.3, 0.4], [5.0, 4.0, 1.0], [0.2, 0.1, -1.0]])
    step = 1e-3
    jacobians = one_sided_jacobians(decay, points, decay(points), BOX, step)
    for derivatives, (a, b, _) in zip(jacobians, points, strict=True):
        exact = np.stack([np.exp(-b * TIME), -a * TIME * np.exp(-b * TIME), np.ones(80)])
        # Half a step times the second derivative, a t² exp(-b t), at most 4 a / (b e)².
        largest = min(4 * a / (b * np.e) ** 2, a * TIME[-1] ** 2)
        np.testing.assert_allclose(derivatives, exact, rtol=0, atol=0.51 * step * largest + 1e-11)


@pytest.mark.parametrize(
    "direction",
    [
        0,
        90,
        180,
        -90,
        -120,
        *(degrees for degrees in (20, 45, 135, -45)),
    ],
)
def test_derivatives_are_right_on_the_circle_of_full_eccentricity(direction: float) -> None:
    space = ParameterSpace.of(THESIS)
    matrix = np.random.default_rng(5).normal(size=(8, 50))
    point = np.full((1, 8), 0.5)
    point[0, 5:7] = np.cos(np.radians(direction)), np.sin(np.radians(direction))
    jacobians = one_sided_jacobians(lambda p: p @ matrix, point, point @ matrix, space, 2e-3)
    # A step along the tangent leaves the circle by half its square: 1e-3 of the step, along the radius.
    np.testing.assert_allclose(jacobians[0], matrix, rtol=0, atol=1.5e-3 * np.abs(matrix).max())
