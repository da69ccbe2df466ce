"""The fault vector: its bounds, its physical values, and the coordinates used by estimators."""

import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given
from numpy.typing import NDArray

from emaphm.actuator import COMPONENTS, NAMES, Actuator, Faults
from emaphm.actuator.faults import (
    CARTESIAN_NAMES,
    HEALTHY,
    check_vectors,
    from_cartesian,
    health_in,
    lower_bounds,
    to_cartesian,
)
from emaphm.errors import FaultError
from strategies import UNIT, fault_vectors, faults

THESIS = Actuator.thesis()


def test_all_components_except_the_eccentricity_phase_can_degrade() -> None:
    assert set(NAMES) - set(COMPONENTS) == {"eccentricity_phase"}
    assert [name for name in NAMES if name in COMPONENTS] == list(COMPONENTS)


@pytest.mark.parametrize("name", NAMES[1:])
@pytest.mark.parametrize("value", [-1e-9, 1 + 1e-9, math.nan, math.inf, -math.inf])
def test_a_component_outside_the_unit_interval_is_named(name: str, value: float) -> None:
    with pytest.raises(FaultError, match=rf"fault {name}=.* outside \[0, 1\]; give a value from 0 to 1"):
        Faults(**{name: value})


@pytest.mark.parametrize("value", [-1 - 1e-9, 1 + 1e-9, math.nan, math.inf, -math.inf])
def test_a_friction_outside_its_range_is_named(value: float) -> None:
    with pytest.raises(FaultError, match=r"fault friction=.* outside \[-1, 1\]; give a value from -1 to 1"):
        Faults(friction=value)


@pytest.mark.parametrize("scale", [0.3, 0.9, 2.0, 20.0])
def test_friction_stays_positive_down_to_the_bound_of_the_actuator(scale: float) -> None:
    actuator = Actuator.from_dict(THESIS.model_dump() | {"faults": {"friction": scale}})
    lowest = lower_bounds(actuator)
    assert np.count_nonzero(lowest) == 1
    # A tenth of healthy, or 1 - 0.3 if the scale is too small for a tenth.
    expected = max(0.1, 1 - scale)
    meaning = Faults(friction=lowest[0]).physical(actuator)["friction_factor"]
    assert meaning == pytest.approx(expected, rel=1e-12)
    check_vectors(np.array([lowest, np.ones(8)]), actuator)
    with pytest.raises(FaultError, match=r"fault friction=-.* of vector 1 lies outside"):
        check_vectors(np.array([HEALTHY.vector, lowest - np.eye(8)[0] * 1e-6]), actuator)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [0, 1, 0.0, 1.0, np.float32(0.5), True])
def test_the_ends_of_the_interval_are_accepted(name: str, value: float) -> None:
    stored = getattr(Faults(**{name: value}), name)
    assert stored == value
    assert type(stored) is float


@pytest.mark.parametrize("value", ["much", None, [0.5]])
def test_a_component_that_is_not_a_number_is_named(value: object) -> None:
    with pytest.raises(FaultError, match="friction"):
        Faults(friction=value)  # type: ignore[arg-type]


def test_names_are_those_of_physics_section_2_in_order_of_k() -> None:
    assert NAMES == (
        "friction",
        "backlash",
        "short_a",
        "short_b",
        "short_c",
        "eccentricity",
        "eccentricity_phase",
        "gain",
    )
    assert HEALTHY.vector.tolist() == [0, 0, 0, 0, 0, 0, 0.5, 0.5]


@given(vector=fault_vectors())
def test_faults_from_their_own_vector_are_equal(vector: NDArray[np.float64]) -> None:
    assert np.array_equal(Faults.from_vector(vector).vector, vector)


@pytest.mark.parametrize("shape", [(), (7,), (9,), (1, 8)])
def test_a_vector_of_another_shape_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(FaultError, match="8 components, got shape"):
        Faults.from_vector(np.zeros(shape))


def test_a_mapping_sets_the_named_components_and_leaves_others_healthy() -> None:
    faults = Faults.from_mapping({"gain": 0.75, "short_b": 0.2})
    assert faults == Faults(gain=0.75, short_b=0.2)
    assert Faults.from_mapping({}) == HEALTHY


def test_a_misspelt_name_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(FaultError, match=r"unknown fault 'fricton' \(did you mean 'friction'\?\)"):
        Faults.from_mapping({"fricton": 0.1})
    with pytest.raises(FaultError, match=r"unknown fault 'zzz' \(known: backlash, .*short_c\)"):
        Faults.from_mapping({"zzz": 0.1})


@pytest.mark.parametrize(
    ("component", "key", "at_0", "at_quarter", "at_1"),
    [
        # The table of docs/physics.md, section 2; k7 and k8 at a quarter as section 11 settles them.
        ("friction", "friction_factor", 1.0, 1.5, 3.0),
        ("backlash", "backlash_rad", 5e-3, 1.625e-2, 5e-2),
        ("short_a", "turns_a", 1.0, 0.75, 0.0),
        ("short_b", "turns_b", 1.0, 0.75, 0.0),
        ("short_c", "turns_c", 1.0, 0.75, 0.0),
        ("eccentricity", "eccentricity_Z", 0.0, 0.105, 0.42),
        ("eccentricity_phase", "eccentricity_phase_rad", -math.pi, -math.pi / 2, math.pi),
        ("gain", "gain_factor", 0.5, 0.75, 1.5),
    ],
)
def test_physical_values_are_those_of_physics_section_2(
    component: str, key: str, at_0: float, at_quarter: float, at_1: float
) -> None:
    for k, expected in ((0.0, at_0), (0.25, at_quarter), (1.0, at_1)):
        meaning = Faults(**{component: k}).physical(THESIS)
        assert meaning[key] == pytest.approx(expected, rel=1e-14)  # a few rounding errors
        assert meaning == HEALTHY.physical(THESIS) | {key: meaning[key]}


def test_healthy_faults_give_the_nominal_values() -> None:
    assert HEALTHY.physical(THESIS) == {
        "friction_factor": 1.0,
        "backlash_rad": 5e-3,
        "turns_a": 1.0,
        "turns_b": 1.0,
        "turns_c": 1.0,
        "eccentricity_Z": 0.0,
        "eccentricity_phase_rad": 0.0,
        "gain_factor": 1.0,
    }


def test_the_scales_are_those_of_the_actuator() -> None:
    values = THESIS.model_dump()
    values["faults"] = {"friction": 4.0, "backlash": 1.0, "eccentricity": 0.2, "gain": 0.1}
    values["mechanics"]["backlash"] = 0.3
    faults = Faults(friction=0.5, backlash=0.5, eccentricity=0.5, gain=1.0)
    meaning = faults.physical(Actuator.from_dict(values))
    assert meaning["friction_factor"] == pytest.approx(3.0)
    assert meaning["backlash_rad"] == pytest.approx(0.45)
    assert meaning["eccentricity_Z"] == pytest.approx(0.1)
    assert meaning["gain_factor"] == pytest.approx(1.1)


@given(made=faults())
def test_cartesian_coordinates_are_those_of_the_physical_eccentricity(made: Faults) -> None:
    point = dict(zip(CARTESIAN_NAMES, to_cartesian(made.vector), strict=True))
    meaning = made.physical(THESIS)
    Z, phi = meaning["eccentricity_Z"], meaning["eccentricity_phase_rad"]
    # Z is 0.42 k6 and phi at most pi: an error of a few ulp of 1.
    assert 0.42 * point["eccentricity_x"] == pytest.approx(Z * math.cos(phi), abs=1e-15)
    assert 0.42 * point["eccentricity_y"] == pytest.approx(Z * math.sin(phi), abs=1e-15)
    other_names = [name for name in NAMES if not name.startswith("eccentricity")]
    assert [point[name] for name in other_names] == [getattr(made, name) for name in other_names]


@given(vector=fault_vectors())
def test_a_round_trip_through_cartesian_coordinates_is_exact(vector: NDArray[np.float64]) -> None:
    original = vector.copy()
    back = from_cartesian(to_cartesian(vector))
    assert np.array_equal(vector, original)
    assert np.array_equal(np.delete(back, [5, 6]), np.delete(vector, [5, 6]))
    assert back[5] == pytest.approx(vector[5], abs=1e-15)
    # The phase is as accurate as the point: about one ulp, unless the radius underflows.
    if vector[5] > 1e-300:
        phase_error = abs(back[6] - vector[6])
        assert min(phase_error, 1 - phase_error) < 1e-15


@given(radius=UNIT)
def test_both_ends_of_the_phase_are_the_same_point(radius: float) -> None:
    low, high = (to_cartesian([0, 0, 0, 0, 0, radius, phase, 0.5]) for phase in (0.0, 1.0))
    np.testing.assert_allclose(low, high, rtol=0, atol=3e-16)  # sin(pi) in binary is 1.2e-16


def test_without_eccentricity_the_phase_is_the_healthy_one() -> None:
    assert from_cartesian(np.zeros(8))[6] == 0.5


def test_many_vectors_are_converted_like_single_vectors() -> None:
    many = np.random.default_rng(1).random((4, 5, 8))
    points = to_cartesian(many)
    assert points.shape == many.shape
    assert np.array_equal(points[2, 3], to_cartesian(many[2, 3]))
    assert np.array_equal(from_cartesian(points)[2, 3], from_cartesian(points[2, 3]))


@pytest.mark.parametrize(
    ("verdicts", "explained", "health"),
    [
        ({}, True, "healthy"),
        ({"gain": "cannot tell"}, True, "cannot tell"),
        ({"gain": "cannot tell", "friction": "degraded"}, True, "degraded"),
        ({"friction": "degraded"}, False, "not explained"),
        ({"eccentricity_phase": "cannot tell"}, True, "healthy"),
    ],
)
def test_a_unit_is_healthy_if_all_components_that_can_degrade_are(
    verdicts: dict[str, str], explained: bool, health: str
) -> None:
    faults = {name: {"verdict": verdicts.get(name, "healthy")} for name in NAMES}
    assert health_in({"explained": explained, "faults": faults}) == health


def test_faults_are_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        HEALTHY.friction = 0.5  # type: ignore[misc]
