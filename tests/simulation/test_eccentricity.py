"""Eccentricity: the cosine of docs/physics.md, section 3, and the printed factor of the thesis (4.5)."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.signal import sawtooth

from emaphm.simulation.laws.eccentricity import gap_factors, printed_factor

ANGLES = st.floats(-np.pi, np.pi)
Z = st.floats(0.0, 0.42)


@given(theta=ANGLES, phi=ANGLES, z=Z)
def test_gap_factors_are_cosines_shifted_by_a_third_of_a_turn(theta: float, phi: float, z: float) -> None:
    signals = [*gap_factors(np.cos(theta), np.sin(theta), z * np.cos(phi), z * np.sin(phi))]
    expected = 1 + z * np.cos(theta + phi + 2 * np.pi / 3 * np.arange(3))
    np.testing.assert_allclose(signals, expected, rtol=0, atol=1e-14)  # some ten roundings


@given(u=ANGLES, phi=ANGLES, z=Z)
def test_printed_factor_is_the_formula_with_a_library_sawtooth(u: float, phi: float, z: float) -> None:
    ripple = np.cos(6 * u - np.pi)
    assume(abs(ripple) > 1e-9)  # the sawtooth jumps where its argument is 0
    signals = printed_factor(np.cos(u), np.sin(u), z * np.cos(phi), z * np.sin(phi))
    expected = 1 - z * (np.cos(u - phi) + sawtooth(ripple) * np.sin(u - np.pi))
    assert signals == pytest.approx(float(expected), abs=1e-13)  # the cosine of 6 u is a cubic of a square


def test_a_centred_rotor_has_a_uniform_gap() -> None:
    u = np.linspace(-np.pi, np.pi, 7)
    assert np.array_equal([*gap_factors(np.cos(u), np.sin(u), 0.0, 0.0)], np.ones((3, 7)))
    assert np.array_equal(printed_factor(np.cos(u), np.sin(u), 0.0, 0.0), np.ones(7))
