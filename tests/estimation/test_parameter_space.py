"""The coordinates of an estimate: projections onto the bounds, and conversion to and from faults."""

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
"""Dry friction of 0.1 times healthy, at a scale of 2."""

ROUNDING = 4e-16
"""Two units in the last place of 1, by the root and the quotient of a radius."""

ANYWHERE = arrays(np.float64, (3, 8), elements=st.floats(-4, 4))


def without(**sections: Any) -> Actuator:
    """Return the thesis's actuator with keys of its sections replaced, or without a section."""
    values = THESIS.model_dump()
    for name, keys in sections.items():
        values[name] = None if keys is None else values[name] | keys
    return Actuator.from_dict(values)


FRICTIONLESS = {
    f"{kind}_friction_{side}": 0.0 for kind in ("static", "dynamic") for side in ("motor", "user")
}


@given(points=ANYWHERE)
def test_projected_points_are_within_bounds_and_projection_is_idempotent(points: Array) -> None:
    given_points = points.copy()
    projected = SPACE.project(points)
    np.testing.assert_array_equal(points, given_points)
    assert np.all(projected >= SPACE.lower)
    assert np.all(projected <= SPACE.upper)
    assert np.all(np.hypot(projected[:, X], projected[:, Y]) <= 1 + ROUNDING)
    np.testing.assert_allclose(SPACE.project(projected), projected, rtol=0, atol=ROUNDING)


@given(faults=fault_vectors())
def test_points_within_bounds_are_not_moved(faults: Array) -> None:
    faults[5] *= 1 - 1e-15  # not on the circle itself, where a radius may round to above 1
    point = SPACE.points(faults)
    np.testing.assert_array_equal(SPACE.project(point), point)
    np.testing.assert_array_equal(SPACE.project(point[np.newaxis])[0], point)


@given(points=ANYWHERE)
def test_components_except_eccentricity_are_clipped_to_their_bounds(points: Array) -> None:
    others, least = [0, 1, 2, 3, 4, 7], [LEAST, 0, 0, 0, 0, 0]
    np.testing.assert_array_equal(SPACE.project(points)[:, others], np.clip(points[:, others], least, 1))


@given(x=st.floats(-1, 1), y=st.floats(-1, 1))
def test_projection_keeps_the_direction_of_the_eccentricity(x: float, y: float) -> None:
    point = SPACE.points(HEALTHY)
    point[[X, Y]] = x, y
    projected = SPACE.project(point)
    radius = np.hypot(x, y)
    np.testing.assert_allclose(projected[[X, Y]] * max(radius, 1), [x, y], rtol=0, atol=2 * ROUNDING)


def test_an_eccentricity_beyond_1_is_projected_onto_the_circle() -> None:
    point = SPACE.points(HEALTHY)
    point[[X, Y]] = 2.0, 0.5
    np.testing.assert_allclose(SPACE.project(point)[[X, Y]], np.array([2, 0.5]) / np.hypot(2, 0.5))


@given(faults=fault_vectors())
def test_faults_are_unchanged_by_conversion_to_points_and_back(faults: Array) -> None:
    back = SPACE.faults(SPACE.points(faults))
    others = [0, 1, 2, 3, 4, 5, 7]
    np.testing.assert_allclose(back[others], faults[others], rtol=0, atol=ROUNDING)
    # The rounding error of the phase is inverse to the radius; on its circle, 0 and 1 are the same.
    difference = back[6] - faults[6]
    difference -= np.round(difference)
    assert abs(difference) * faults[5] <= 2 * ROUNDING


@given(points=ANYWHERE)
def test_points_are_unchanged_by_conversion_to_faults_and_back(points: Array) -> None:
    allowed = SPACE.project(points)
    faults = SPACE.faults(allowed)
    assert np.all((faults >= lower_bounds(THESIS)) & (faults <= 1))
    np.testing.assert_allclose(SPACE.points(faults), allowed, rtol=0, atol=4 * ROUNDING)


@given(unit=arrays(np.float64, (3, 8), elements=st.floats(0, 1)))
def test_the_prior_transform_maps_the_unit_cube_to_faults(unit: Array) -> None:
    faults = SPACE.faults(SPACE.prior_transform(unit))
    np.testing.assert_allclose(faults[:, :6], unit[:, :6], rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(SPACE.prior_transform(unit), SPACE.points(unit))


def test_friction_may_be_below_healthy_except_in_searches_of_the_thesis() -> None:
    assert SPACE.limits("friction") == (LEAST, 1.0)
    assert {SPACE.limits(name) for name in NAMES[1:]} == {(0.0, 1.0)}
    published = ParameterSpace.of(THESIS, below_healthy=False)
    assert published.limits("friction") == (0.0, 1.0)
    point = SPACE.points(HEALTHY)[np.newaxis] - np.eye(8)[0]
    assert SPACE.faults(SPACE.project(point))[0, 0] == LEAST
    assert published.faults(published.project(point))[0, 0] == 0


def test_every_fault_of_the_thesis_actuator_is_estimated() -> None:
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
def test_a_fault_without_effect_is_fixed_with_its_reason(
    actuator: Actuator, reason: str, names: tuple[str, ...]
) -> None:
    space = ParameterSpace.of(actuator)
    assert set(space.fixed) == set(names)
    assert all(reason in text for text in space.fixed.values())
    assert [NAMES[i] for i in space.columns] == [name for name in NAMES if name not in names]
    # At any point, the fixed components are healthy.
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
    # Radius and phase are estimated together, since both are coordinates of one circle.
    assert ("eccentricity" in estimated) == ("eccentricity_phase" in estimated)
    assert "gain" in estimated


def test_a_box_clips_points_to_its_bounds() -> None:
    box = Box(np.array([-1.0, 0.0]), np.array([1.0, 3.0]))
    np.testing.assert_array_equal(box.project(np.array([[-2.0, 5.0], [0.5, 1.0]])), [[-1, 3], [0.5, 1]])
