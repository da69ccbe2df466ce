"""Quantities of three phases: operations act on each phase, with common operands."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from emaphm.simulation.laws.phases import Phases, by_phase, phase_names
from emaphm.simulation.laws.select import clip, select

ONE, OTHER = np.random.default_rng(3).normal(size=(2, 3, 5))

OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "two of them": lambda x, y: x * y - x / y,
    "with a number on either side": lambda x, _: 2.0 - 3.0 * x + x * 0.5,
    "with an array on either side": lambda x, _: OTHER[0] * x + x / OTHER[1],
    "functions": lambda x, y: np.copysign(np.sqrt(np.abs(x)), -y),
    "choices among phases": lambda x, y: select((x < y) & (y > 0.0), x, y),
    "choices of numbers": lambda x, _: select(x == 0.0, 1.0, clip(x, -0.5, 0.5)),
    "a choice for all": lambda x, y: select(OTHER[2] > 0.0, x, y),
}


@pytest.mark.parametrize("operation", OPERATIONS.values(), ids=list(OPERATIONS))
def test_operations_on_phases_act_on_each_phase(operation: Callable[[Any, Any], Any]) -> None:
    assert np.array_equal([*operation(Phases(*ONE), Phases(*OTHER))], operation(ONE, OTHER))


def test_phases_are_summed_in_total_and_in_pairs() -> None:
    assert np.array_equal(Phases(*ONE).sum(), ONE[0] + ONE[1] + ONE[2])
    np.testing.assert_allclose([*Phases(*ONE).of_pairs()], ONE.sum(axis=0) - ONE, atol=1e-15)


def test_phases_are_read_by_name() -> None:
    class Values:
        flux_a, flux_b, flux_c, torque = 1.0, 2.0, 3.0, 4.0

    assert [*Phases.of(Values, "flux")] == [1.0, 2.0, 3.0]
    assert list(by_phase("flux", ONE)) == list(phase_names("flux")) == ["flux_a", "flux_b", "flux_c"]


def test_operations_that_do_not_act_on_each_phase_are_refused() -> None:
    with pytest.raises(TypeError, match="no implementation found"):
        np.concatenate([Phases(*ONE), Phases(*OTHER)])
    with pytest.raises(TypeError, match="reduce"):
        np.maximum.reduce(Phases(*ONE))  # type: ignore[call-overload]
