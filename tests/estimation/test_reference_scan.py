"""A scan of a parameter: its best value, and the standard deviation of the logarithm."""

import math

import pytest

from emaphm.estimation.reference.scan import scan

VALUES = tuple(2.0 ** (i / 2) for i in range(11))


@pytest.mark.parametrize("best", range(2, 9))
def test_the_error_of_a_sharp_minimum_is_the_distance_to_the_next_values(best: int) -> None:
    minimum = scan(VALUES, lambda value: value, lambda value: 1 + math.log(value / VALUES[best]) ** 2 * 100)
    assert minimum.value == minimum.estimate == pytest.approx(VALUES[best])
    # Uniformly distributed between the neighbours, whose ratio is 2.
    assert minimum.deviation == pytest.approx(math.log(2) / math.sqrt(12))


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_a_minimum_between_two_values_is_interpolated(share: float) -> None:
    true = VALUES[4] ** (1 - share) * VALUES[5] ** share
    minimum = scan(VALUES, lambda value: value, lambda value: 0.1 + math.log(value / true) ** 2)
    assert minimum.value == pytest.approx(true, rel=0.01)


def test_values_that_fit_alike_widen_the_error() -> None:
    minimum = scan(VALUES, lambda value: value, lambda value: 1.0 if 2 <= value <= 8 else 3.0)
    lower, upper = 2 / math.sqrt(2), 8 * math.sqrt(2)
    assert minimum.deviation == pytest.approx(math.log(upper / lower) / math.sqrt(12))


@pytest.mark.parametrize("power", [-1, 0, 1])
def test_a_minimum_at_an_end_has_an_infinite_error(power: int) -> None:
    assert scan(VALUES, lambda value: value, lambda value: value**power).deviation == math.inf
