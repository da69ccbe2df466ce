"""Notes on levels: a level at the end of its scale, or an eccentricity whose direction turns."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.requirements import Requirement
from emaphm.arrays import Array
from emaphm.prognosis import failure_levels, prognose
from emaphm.prognosis.bounds import BEYOND, bounds, to_the_end, within_bounds
from emaphm.prognosis.notes.levels import level_notes, turn_of_eccentricity
from emaphm.prognosis.prior import NEW

from .diagnosed import at, diagnosed


def eccentric(magnitude: float, angle: float) -> Array:
    return np.array([0, 0, 0, 0, 0, magnitude * math.cos(angle), magnitude * math.sin(angle), 0])


@pytest.mark.usefixtures("few_steps")
def test_a_level_at_the_end_of_its_scale_reaches_a_limit_at_that_end() -> None:
    """For a level of 1 with a standard error of 0.002, half of the probability is at 1 or above."""
    actuator = Actuator.thesis().model_copy(
        update={"requirements": (Requirement(component="friction", at_most=1.0),)}
    )
    prognosis = prognose(diagnosed(lambda _: at(1.0), error=0.01), actuator, keep_past=False)
    # Three standard errors of the mean of 20 diagnoses shift the half to 0.1 or 0.9 at most.
    assert 0.1 < np.mean(prognosis.sample == 0) < 0.95
    assert prognosis.advice.hours == 0
    assert any("end of its scale" in note and "friction" in note for note in prognosis.notes)
    below = prognose(diagnosed(lambda _: at(0.9), error=0.01), actuator, keep_past=False)
    assert not np.any(below.sample == 0)
    assert not any("end of its scale" in note for note in below.notes)


@pytest.mark.usefixtures("few_steps")
def test_a_falling_friction_stops_at_the_least_level_that_the_actuator_allows() -> None:
    """The thesis's friction has the scale 2, so its level is -0.45 when it has fallen to a tenth."""
    limits = tuple(Requirement(component="friction", at_least=bound) for bound in (-0.6, -0.45))
    actuator = Actuator.thesis().model_copy(update={"requirements": limits})
    unreachable, reachable = failure_levels(actuator)
    assert not unreachable.can_fail
    assert reachable.levels["friction"][1] == pytest.approx(-0.45)
    falls = prognose(diagnosed(lambda hours: at(-4e-4 * hours)), actuator, keep_past=False)
    of_unreachable, of_reachable = falls.times.hours
    assert np.all(np.isinf(of_unreachable))
    assert np.median(of_reachable) == pytest.approx(0.05 / 4e-4, rel=0.2)
    assert falls.paths.level[0, :, 0].min() >= -0.45 - BEYOND
    assert any("no single fault" in note and "-0.6" in note for note in falls.notes)
    ends = prognose(diagnosed(lambda _: at(-0.45), error=0.01), actuator, keep_past=False)
    assert any("end of its scale" in note and "friction" in note for note in ends.notes)


@pytest.mark.parametrize("turn", [math.pi / 2, -2 * math.pi])
@pytest.mark.parametrize("grows", [True, False])
def test_a_turning_eccentricity_is_noted(turn: float, grows: bool) -> None:
    evidence = diagnosed(lambda h: eccentric(4e-4 * h if grows else 0.3, turn * h / 1000))
    # From the first diagnosis at 50 h, or from when a growing eccentricity has a direction, to the last one.
    assert turn_of_eccentricity(evidence) == pytest.approx(0.95 * turn, rel=0.1)
    (note,) = level_notes(evidence, np.tile(NEW, (10, 1)))
    assert "eccentricity has turned" in note


@pytest.mark.parametrize(
    "level",
    [
        lambda _: eccentric(0.0, 0.0),
        lambda h: eccentric(4e-4 * h, 3.1),
        lambda h: eccentric(0.3, 2.0 if h > 500 else 0.0),
    ],
    ids=["healthy", "grows in one direction", "jumps once"],
)
def test_an_eccentricity_that_does_not_turn_is_not_noted(level: Callable[[float], Array]) -> None:
    for seed in range(30):
        assert level_notes(diagnosed(level, seed=seed), np.tile(NEW, (10, 1))) == []


def test_distances_to_the_end_of_the_scale_and_bounds_of_levels() -> None:
    assert np.all(to_the_end(NEW) > 0.4)
    worst = np.array([1.0, 1.0, 1.2, 1.0, 1.0, 0.8, -0.6, 0.0])
    assert to_the_end(worst) == pytest.approx(0.0)
    low, high = bounds(8, 0.1)
    assert np.all(low[1:5] == 0)
    far = within_bounds(np.array([[3.0] * 8, [-3.0] * 8]), 0.1)
    assert np.all((low <= far) & (far <= high))
    assert np.hypot(far[:, 5], far[:, 6]) == pytest.approx(1.1)
