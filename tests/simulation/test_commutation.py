"""Commutation: the trapezoid of docs/physics.md, section 3, and the conducting phases."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.simulation.laws.angles import PHASE_SHIFT, phase_angles, wrap, wrap_once
from emaphm.simulation.laws.commutation import demand_sign, of_idle_phase, trapezoid
from emaphm.simulation.laws.phases import Phases
from simulation import scalar_reference

ANGLES = st.floats(-1e3, 1e3)
ROUNDING = 2e-12
"""Rounding error of an angle up to 1e3 rad, some 1e-13 rad, on a ramp of 1 / (pi / 6)."""


def phases(angle: float) -> list[float]:
    """Return the wrapped angles of the three phases."""
    return [float(wrap(angle - i * PHASE_SHIFT)) for i in range(3)]


def idle_phase(angle: float) -> list[float]:
    """Return three weights, 1 for the phase that idles and 0 for the others."""
    return [float(of_idle_phase(angle, Phases(*np.eye(3)[i]))) for i in range(3)]


def near_boundary(angle: float) -> bool:
    """Return whether a phase is so near the end of a flat that its side depends on rounding."""
    to_flat = (np.asarray(angle) - np.pi / 6) % (np.pi / 3)
    return bool(min(to_flat, np.pi / 3 - to_flat) < 1e-9)


@pytest.mark.parametrize(
    ("degrees", "s", "r"),
    [
        (0, 0, 0),
        (15, 0.5, 0),
        (29.9, 29.9 / 30, 0),
        (30.1, 1, 1),
        (90, 1, 1),
        (149.9, 1, 1),
        (165, 0.5, 0),
        (180, 0, 0),
        (195, -0.5, 0),
        (210.1, -1, -1),
        (270, -1, -1),
        (329.9, -1, -1),
        (345, -0.5, 0),
        (360, 0, 0),
    ],
)
def test_trapezoid_and_demand_at_the_angles_of_physics_section_3(degrees: float, s: float, r: float) -> None:
    for turns in (-2, 0, 1):
        angle = wrap(np.radians(degrees + 360 * turns))
        assert trapezoid(angle) == pytest.approx(s, abs=ROUNDING)
        assert demand_sign(angle) == r


@pytest.mark.parametrize("degrees", [30, 150, 210, 330])
def test_trapezoid_is_full_at_the_ends_of_its_flats(degrees: float) -> None:
    assert abs(trapezoid(wrap(np.radians(degrees)))) == pytest.approx(1, abs=ROUNDING)


def test_arrays_are_evaluated_as_single_angles() -> None:
    degrees = np.linspace(-360, 720, 1000)
    angles = wrap(np.radians(degrees))
    expected = [scalar_reference.trapezoid(d) for d in degrees]
    np.testing.assert_allclose(trapezoid(angles), expected, rtol=0, atol=ROUNDING)
    assert demand_sign(angles).tolist() == [scalar_reference.demand(d) for d in degrees]


@given(angle=ANGLES)
def test_wrap_keeps_the_direction_and_returns_an_angle_within_one_turn(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -np.pi <= wrapped < np.pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=ROUNDING)


@given(angle=st.floats(-3 * np.pi, 3 * np.pi, exclude_max=True))
def test_wrap_once_is_sufficient_within_three_turns(angle: float) -> None:
    wrapped = float(wrap_once(angle))
    assert -np.pi <= wrapped <= np.pi
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * angle), abs=1e-14)


@given(angle=st.floats(-np.pi, np.pi, exclude_max=True))
def test_angles_of_phases_differ_by_a_third_of_a_turn(angle: float) -> None:
    angles = np.array([*phase_angles(angle)], float)
    assert np.all((angles >= -np.pi) & (angles <= np.pi))
    np.testing.assert_allclose(np.exp(1j * angles), np.exp(1j * np.array(phases(angle))), atol=1e-14)


@given(angle=ANGLES)
def test_the_trapezoid_is_odd_and_has_half_wave_symmetry(angle: float) -> None:
    s = float(trapezoid(wrap(angle)))
    assert -1 <= s <= 1
    assert float(trapezoid(wrap(-angle))) == pytest.approx(-s, abs=ROUNDING)
    assert float(trapezoid(wrap(angle + np.pi))) == pytest.approx(-s, abs=ROUNDING)
    assert float(trapezoid(wrap(angle + 2 * np.pi))) == pytest.approx(s, abs=ROUNDING)


@given(angle=ANGLES)
def test_one_phase_is_idle_and_the_others_are_on_opposite_flats(angle: float) -> None:
    weights = np.array(idle_phase(wrap(angle)))
    assert sorted(weights) == [0, 0, 1]
    s = np.array([float(trapezoid(a)) for a in phases(angle)])
    # The trapezoid of the idle phase is the sum of all three.
    assert s.sum() == pytest.approx(s @ weights, abs=ROUNDING)
    if not near_boundary(angle):
        r = np.array([float(demand_sign(a)) for a in phases(angle)])
        assert np.array_equal(r == 0, weights == 1)
        assert r.sum() == 0
        assert r @ s == pytest.approx(2, abs=ROUNDING)


@pytest.mark.parametrize("degrees", range(-180, 180, 30))
def test_exactly_one_phase_is_idle_at_the_boundary_of_sectors(degrees: float) -> None:
    assert sorted(idle_phase(np.radians(degrees))) == [0, 0, 1]


@pytest.mark.parametrize(
    ("sector", "idle"),
    # f(theta) of thesis 4.4: b and c conduct about 0 deg, a and b about 60, a and c about 120.
    [(0, 0), (60, 2), (120, 1), (180, 0), (240, 2), (300, 1)],
)
def test_sectors_are_those_of_the_thesis(sector: float, idle: int) -> None:
    for within in (-29.9, 0.0, 29.9):
        assert idle_phase(wrap(np.radians(sector + within))).index(1.0) == idle
