"""Backlash: properties of the play operator, its hysteresis loop, and lost motion in a run."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from emaphm.actuator import Faults, Sine
from emaphm.simulation import MODELS
from emaphm.simulation.laws.backlash import follow
from simulation.rig import record

ANGLES = st.lists(st.floats(-10, 10), min_size=1, max_size=30)
HALF = st.floats(0.0, 3.0)
ROUNDING = 4e-15
"""Rounding error of a sum of values up to 13."""


def followed(angles: NDArray[np.float64] | list[float], half: float, start: float = 0.0) -> list[float]:
    outputs = []
    for angle in angles:
        start = float(follow(start, angle, half))
        outputs.append(start)
    return outputs


@given(angles=ANGLES, half=HALF)
def test_the_output_is_within_half_the_gap(angles: list[float], half: float) -> None:
    lag = np.array(angles) - followed(angles, half)
    assert np.abs(lag).max() <= half + ROUNDING


@given(angles=ANGLES, half=HALF)
def test_the_output_moves_only_at_the_edge_of_the_gap(angles: list[float], half: float) -> None:
    outputs = [0.0, *followed(angles, half)]
    for before, after, angle in zip(outputs, outputs[1:], angles, strict=False):
        if abs(angle - before) <= half - ROUNDING:
            assert after == before
        elif after != before:
            # The output follows in the direction of the motion, half the gap behind.
            assert after - before == pytest.approx(
                (angle - before) - np.sign(angle - before) * half, abs=ROUNDING
            )


@given(angles=ANGLES, half=HALF, lift=st.floats(0, 5))
def test_the_output_is_monotonic_in_the_input(angles: list[float], half: float, lift: float) -> None:
    higher = [angle + lift for angle in angles]
    assert np.all(np.array(followed(higher, half)) >= np.array(followed(angles, half)) - ROUNDING)


@given(angles=ANGLES, half=HALF)
def test_the_output_does_not_depend_on_the_resolution_of_the_path(angles: list[float], half: float) -> None:
    path = [0.0, *angles]
    fine = [p + (q - p) * part for p, q in pairwise(path) for part in (0.25, 0.5, 0.75, 1)]
    assert followed(fine, half)[3::4] == pytest.approx(followed(angles, half), abs=ROUNDING)


def test_without_a_gap_the_output_is_the_input() -> None:
    angles = [0.3, -2.0, 5.5]
    assert followed(angles, 0.0) == angles


@pytest.mark.parametrize(("amplitude", "gap"), [(1.0, 0.3), (0.02, 5e-3), (1.0, 1.9)])
def test_the_area_of_the_hysteresis_loop_is_the_closed_form(amplitude: float, gap: float) -> None:
    steps = 2000
    x = amplitude * np.sin(2 * np.pi * np.arange(2 * steps + 1) / steps)
    y = np.array(followed(x, gap / 2))
    x, y = x[steps:], y[steps:]  # the first period is a transient
    area = abs(np.sum((y[1:] + y[:-1]) / 2 * np.diff(x)))
    # A parallelogram: rising, y = x - gap/2; falling, y = x + gap/2; at rest at ±(A - gap/2) over one gap.
    expected = gap * 2 * (amplitude - gap / 2)
    # The peaks are exact; a corner has an error of half a step of at most 2 pi A / 2000.
    assert area == pytest.approx(expected, abs=4 * (2 * np.pi * amplitude / steps) ** 2)


@pytest.mark.parametrize("amplitude", [0.1, 0.15])
def test_a_motion_smaller_than_the_gap_does_not_move_the_output(amplitude: float) -> None:
    assert not np.any(followed(amplitude * np.sin(np.linspace(0, 20, 500)), 0.15))


@pytest.mark.parametrize("model", list(MODELS))
@pytest.mark.parametrize("k2", [0.0, 0.5, 1.0])
def test_the_motor_crosses_the_gap_at_each_reversal(model: str, k2: float) -> None:
    width = 5e-3 * (1 + 9 * k2)
    chosen = MODELS[model]
    signals = record(chosen, Sine(5e-3, 8.0), faults=Faults(backlash=k2), duration=0.2, interval=chosen.step)
    ahead = signals["angle_rad"] - signals["position_rad"] * 500
    # The position of the user is at most 250 motor radians, which double precision resolves to 1e-13.
    assert ahead.max() == pytest.approx(width / 2, abs=1e-12)
    assert ahead.min() == pytest.approx(-width / 2, abs=1e-12)
    inside = np.abs(ahead) < width / 2 - 1e-9
    moved = np.diff(signals["position_rad"])
    assert inside.sum() > 10 * (k2 > 0)
    assert not moved[inside[1:]].any()
