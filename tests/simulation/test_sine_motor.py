"""The motor with sinusoidal back-EMF: line values against their definitions by phases, and power."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.simulation.laws.phases import Phases
from emaphm.simulation.laws.sine_motor import (
    INVERSE_SQRT3,
    line_currents,
    line_voltages,
    phase_sines,
    phase_voltages,
)

ANGLES = st.floats(-20, 20)
AMPERES = st.floats(-30, 30)
SHIFTS = 2 * np.pi / 3 * np.arange(3)


@given(angle=ANGLES)
def test_the_back_emf_line_to_line_has_the_amplitude_of_the_constant(angle: float) -> None:
    shapes = np.array([*phase_sines(np.cos(angle), np.sin(angle))])
    np.testing.assert_allclose(shapes, np.sin(angle - SHIFTS), atol=1e-14)
    a_to_b = INVERSE_SQRT3 * (shapes[0] - shapes[1])
    assert a_to_b == pytest.approx(np.sin(angle + np.pi / 6), abs=1e-14)


@given(angle=ANGLES, in_d=AMPERES, in_q=AMPERES)
def test_voltages_in_d_and_q_are_transformed_to_phases_and_back(
    angle: float, in_d: float, in_q: float
) -> None:
    cos, sin = np.cos(angle), np.sin(angle)
    legs = phase_voltages(in_d, in_q, cos, sin)
    phases = np.array([*legs])
    transformed = np.array(line_voltages(legs + 17.0, cos, sin))
    np.testing.assert_allclose(transformed, np.array([in_d, in_q]), atol=1e-12)
    lines = phases - np.roll(phases, -1)
    # The amplitude of three balanced values is √(3/2) times their rms.
    assert np.sqrt(np.sum(lines**2) * 2 / 3) == pytest.approx(np.hypot(in_d, in_q), abs=1e-12)


@given(angle=ANGLES, voltages=st.tuples(AMPERES, AMPERES, AMPERES), currents=st.tuples(AMPERES, AMPERES))
def test_line_values_conserve_power(
    angle: float, voltages: tuple[float, float, float], currents: tuple[float, float]
) -> None:
    phases = (currents[0], currents[1], -sum(currents))
    cos, sin = np.cos(angle), np.sin(angle)
    in_lines = np.dot(line_voltages(Phases(*voltages), cos, sin), line_currents(Phases(*phases), cos, sin))
    assert in_lines == pytest.approx(np.dot(voltages, phases), abs=1e-9)


@given(angle=ANGLES, currents=st.tuples(AMPERES, AMPERES))
def test_the_torque_is_the_constant_times_the_current_in_q(
    angle: float, currents: tuple[float, float]
) -> None:
    phases = (currents[0], currents[1], -sum(currents))
    per_constant = np.sum(INVERSE_SQRT3 * np.sin(angle - SHIFTS) * phases)
    assert line_currents(Phases(*phases), np.cos(angle), np.sin(angle))[1] == pytest.approx(
        per_constant, abs=1e-12
    )
