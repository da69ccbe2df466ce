"""The coordinates of an estimate: what projections promise, and faults to points and back."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cases import HEALTHY, THESIS
from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.faults import lower_bounds
from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import Box, ParameterSpace
from strategies import actuators, fault_vectors

SPACE = ParameterSpace.of(THESIS)
X, Y = 5, 6
LEAST = -0.45
"""Friction 0.1 times healthy, its scale being 2."""

ROUNDING = 4e-16
"""Two units in the last place of 1: a radius is a root and a quotient."""

ANYWHERE = arrays(np.float64, (3, 8), elements=st.floats(-4, 4))


def without(**sections: Any) -> Actuator:
    """Return the thesis's actuator with keys of its sections set, or without a section."""
    values = THESIS.model_dump()
    for name, keys in sections.items():
        values[name] = None if keys is None else values[name] | keys
    return Actuator.from_dict(values)


FRICTIONLESS = {
    f"{kind}_friction_{side}": 0.0 for kind in ("static", "dynamic") for side in ("motor", "user")
}


@given(points=ANYWHERE)
def test_projected_points_are_allowed_and_stay_where_they_are(points: Array) -> None:
    given_points = points.copy()
    projected = SPACE.project(points)
    np.testing.assert_array_equal(points, given_points)
    assert np.all(projected >= SPACE.lower)
    assert np.all(projected <= SPACE.upper)
    assert np.all(np.hypot(projected[:, X], projected[:, Y]) <= 1 + ROUNDING)
    np.testing.assert_allclose(SPACE.project(projected), projected, rtol=0, atol=ROUNDING)


@given(faults=fault_vectors())
def test_allowed_points_are_not_moved(faults: Array) -> None:
    faults[5] *= 1 - 1e-15  # not on the circle itself, where a radius may round to above 1
    point = SPACE.points(faults)
    np.testing.assert_array_equal(SPACE.project(point), point)
    np.testing.assert_array_equal(SPACE.project(point[np.newaxis])[0], point)


@given(points=ANYWHERE)
def test_what_is_no_eccentricity_goes_to_the_nearest_bound(points: Array) -> None:
    others, least = [0, 1, 2, 3, 4, 7], [LEAST, 0, 0, 0, 0, 0]
    np.testing.assert_array_equal(SPACE.project(points)[:, others], np.clip(points[:, others], least, 1))


@given(x=st.floats(-1, 1), y=st.floats(-1, 1))
def test_the_eccentricity_keeps_its_direction(x: float, y: float) -> None:
    point = SPACE.points(HEALTHY)
    point[[X, Y]] = x, y
    projected = SPACE.project(point)
    radius = np.hypot(x, y)
    np.testing.assert_allclose(projected[[X, Y]] * max(radius, 1), [x, y], rtol=0, atol=2 * ROUNDING)


def test_a_far_eccentricity_goes_to_the_nearest_point_of_the_circle() -> None:
    point = SPACE.points(HEALTHY)
    point[[X, Y]] = 2.0, 0.5
    np.testing.assert_allclose(SPACE.project(point)[[X, Y]], np.array([2, 0.5]) / np.hypot(2, 0.5))


@given(faults=fault_vectors())
def test_faults_to_points_and_back(faults: Array) -> None:
    back = SPACE.faults(SPACE.points(faults))
    others = [0, 1, 2, 3, 4, 5, 7]
    np.testing.assert_allclose(back[others], faults[others], rtol=0, atol=ROUNDING)
    # The phase, known as well as the radius is large, on its circle: 0 and 1 are the same.
    apart = back[6] - faults[6]
    apart -= np.round(apart)
    assert abs(apart) * faults[5] <= 2 * ROUNDING


@given(points=ANYWHERE)
def test_points_to_faults_and_back(points: Array) -> None:
    allowed = SPACE.project(points)
    faults = SPACE.faults(allowed)
    assert np.all((faults >= lower_bounds(THESIS)) & (faults <= 1))
    np.testing.assert_allclose(SPACE.points(faults), allowed, rtol=0, atol=4 * ROUNDING)


@given(unit=arrays(np.float64, (3, 8), elements=st.floats(0, 1)))
def test_spread_points_are_the_faults_of_the_unit_cube(unit: Array) -> None:
    faults = SPACE.faults(SPACE.prior_transform(unit))
    np.testing.assert_allclose(faults[:, :6], unit[:, :6], rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(SPACE.prior_transform(unit), SPACE.points(unit))


def test_friction_may_be_below_healthy_unless_searched_as_in_the_thesis() -> None:
    assert SPACE.limits("friction") == (LEAST, 1.0)
    assert {SPACE.limits(name) for name in NAMES[1:]} == {(0.0, 1.0)}
    published = ParameterSpace.of(THESIS, below_healthy=False)
    assert published.limits("friction") == (0.0, 1.0)
    point = SPACE.points(HEALTHY)[np.newaxis] - np.eye(8)[0]
    assert SPACE.faults(SPACE.project(point))[0, 0] == LEAST
    assert published.faults(published.project(point))[0, 0] == 0


def test_the_thesis_actuator_can_show_every_fault() -> None:
    assert SPACE.fixed == {}
    assert SPACE.columns == tuple(range(8))
    assert SPACE.dimensions == 8


@pytest.mark.parametrize(
    ("actuator", "reason", "names"),
    [
        (without(electrical=None), "electrical description", NAMES[2:7]),
        (without(mechanics={"backlash": 0.0}), "healthy backlash is zero", ["backlash"]),
        (without(mechanics=FRICTIONLESS), "healthy friction is zero", ["friction"]),
    ],
    ids=["no windings", "no backlash", "no friction"],
)
def test_a_fault_that_cannot_show_is_fixed_with_its_reason(
    actuator: Actuator, reason: str, names: tuple[str, ...]
) -> None:
    space = ParameterSpace.of(actuator)
    assert set(space.fixed) == set(names)
    assert all(reason in text for text in space.fixed.values())
    assert [NAMES[i] for i in space.columns] == [name for name in NAMES if name not in names]
    # Whatever the point, the fixed ones are healthy.
    faults = space.faults(space.project(np.full((1, space.dimensions), 0.3)))[0]
    for i, name in enumerate(NAMES):
        assert (faults[i] == HEALTHY[i]) == (name in names)


@settings(max_examples=15)
@given(actuator=actuators())
def test_every_fault_is_either_estimated_or_fixed(actuator: Actuator) -> None:
    space = ParameterSpace.of(actuator)
    estimated = [NAMES[i] for i in space.columns]
    assert sorted(estimated + list(space.fixed)) == sorted(NAMES)
    assert space.lower.shape == space.upper.shape == (space.dimensions,)
    # Radius and phase go together, or the circle would be cut.
    assert ("eccentricity" in estimated) == ("eccentricity_phase" in estimated)
    assert "gain" in estimated


def test_a_box_clips() -> None:
    box = Box(np.array([-1.0, 0.0]), np.array([1.0, 3.0]))
    np.testing.assert_array_equal(box.project(np.array([[-2.0, 5.0], [0.5, 1.0]])), [[-1, 3], [0.5, 1]])
