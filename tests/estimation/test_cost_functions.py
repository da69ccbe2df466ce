"""Cost functions against values by hand; each is zero for equal currents and grows with the difference."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from emaphm.arrays import Array
from emaphm.estimation import COST_FUNCTIONS

EACH = pytest.mark.parametrize("name", sorted(COST_FUNCTIONS))
CURRENTS = arrays(np.float64, 12, elements=st.floats(-50, 50))

# Slopes, by central differences and one-sided at the ends: 2, 3, 1, -2 A/s.
RECORDED, INTERVAL = np.array([0.0, 1.0, 3.0, 2.0]), 0.5
# Differences of 1, 2, 0 and 3 A in the first row, and no difference in the second.
SIMULATED = np.array([[1.0, 3.0, 3.0, -1.0], RECORDED])


def test_least_squares_is_the_mean_square() -> None:
    fitness = COST_FUNCTIONS["least_squares"](RECORDED, SIMULATED, INTERVAL)
    np.testing.assert_allclose(fitness, [(1 + 4 + 9) / 4, 0])


def test_the_thesis_divides_each_square_by_the_length_of_the_tangent() -> None:
    fitness = COST_FUNCTIONS["thesis"](RECORDED, SIMULATED, INTERVAL)
    by_hand = 0.5 * (1 / np.sqrt(5) + 4 / np.sqrt(10) + 9 / np.sqrt(5))
    np.testing.assert_allclose(fitness, [by_hand, 0])


def test_total_least_squares_is_the_squared_distance_from_the_tangent() -> None:
    fitness = COST_FUNCTIONS["total_least_squares"](RECORDED, SIMULATED, INTERVAL)
    np.testing.assert_allclose(fitness, [0.5 * (1 / 5 + 4 / 10 + 9 / 5), 0])


@EACH
@given(recorded=CURRENTS, difference=CURRENTS)
def test_zero_for_equal_currents_and_quadratic_in_the_difference(
    name: str, recorded: Array, difference: Array
) -> None:
    simulated = recorded + np.array([[0.0], [1.0], [2.0], [-1.0]]) * difference
    equal, once, twice, mirrored = COST_FUNCTIONS[name](recorded, simulated, 2e-4)
    assert equal == 0
    # Rounding of the differences: 1e-14 of currents of 50 A; dI/dt scales all of them equally.
    assert twice == pytest.approx(4 * once, rel=1e-9, abs=1e-20)
    assert mirrored == pytest.approx(once, rel=1e-9, abs=1e-20)
    assert np.all(np.asarray([once, twice]) >= 0)


@EACH
def test_currents_nearer_to_the_recorded_one_have_a_lower_cost(name: str) -> None:
    time = np.arange(200) * 1e-3
    recorded = 5 * np.sin(20 * time)
    errors = np.array([0.5, 0.0, 0.1, 2.0])
    simulated = recorded + errors[:, np.newaxis] * np.cos(33 * time)
    assert np.argsort(COST_FUNCTIONS[name](recorded, simulated, 1e-3)).tolist() == [1, 2, 0, 3]


@pytest.mark.parametrize("name", ["thesis", "total_least_squares"])
def test_a_difference_counts_less_where_the_current_is_steep(name: str) -> None:
    recorded = np.concatenate([np.zeros(50), np.linspace(0, 10, 50)])
    flat, steep = recorded.copy(), recorded.copy()
    flat[20] += 1
    steep[70] += 1
    fitness = COST_FUNCTIONS[name](recorded, np.stack([flat, steep]), 1e-3)
    # dI/dt is 10 A in 49 ms.
    length = np.sqrt((10 / 49e-3) ** 2 + 1)
    assert fitness[0] / fitness[1] == pytest.approx(length if name == "thesis" else length**2)


@EACH
def test_cost_functions_do_not_change_their_arguments(name: str) -> None:
    recorded, simulated = RECORDED.copy(), SIMULATED.copy()
    COST_FUNCTIONS[name](recorded, simulated, INTERVAL)
    np.testing.assert_array_equal(recorded, RECORDED)
    np.testing.assert_array_equal(simulated, SIMULATED)
