"""Friction from the size of the current: closed forms, a simulated actuator, and its verdict."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Faults
from emaphm.arrays import Array
from emaphm.detection.stroke_friction import HealthyFriction, StrokeCurrent, current_per_load
from emaphm.errors import RecordingError
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

from .rig import COMMAND, Rig, runs


def test_strokes_give_friction_and_load_exactly() -> None:
    rig = Rig(noise=0.0, run_scatter=0.0)
    pairs = []
    for load in (-400.0, 200.0, 400.0):
        found = StrokeCurrent.of(runs(rig, 1, seed=0, load=load)[0][0])
        assert found.friction_A == pytest.approx(0.8)
        assert found.load_A == pytest.approx(5e-4 * load)
        pairs.append((found, load))
    assert current_per_load([one for one, _ in pairs], [load for _, load in pairs]) == pytest.approx(5e-4)
    assert np.isnan(current_per_load([pairs[0][0]], [0.0]))


def triangle(time: Array) -> Array:
    """Return a command that goes up and down at 0.05 rad/s [rad]."""
    return np.asarray(0.01 * (1 - np.abs(1 - np.asarray(time) / 0.2)))


@pytest.mark.parametrize("friction", [0.1, 0.25])
def test_a_simulated_actuator_takes_as_much_more_current_as_it_has_friction(friction: float) -> None:
    def current(faults: Faults) -> float:
        recording = simulate(THESIS, triangle, faults=faults, model="averaged", duration=0.4, load=0.02)
        return StrokeCurrent.of(recording).friction_A

    healthy = current(Faults())
    reference = HealthyFriction(healthy, 1e-3 * healthy, 1e-3 * healthy, 10)
    found = reference.judge(current(Faults(friction=friction)))
    # Viscous friction grows with it, torque for the last acceleration does not: a tenth remains of it.
    assert found.value == pytest.approx(friction, rel=0.1)
    assert found.verdict == "degraded"


def test_less_friction_than_healthy_is_below_zero_and_no_fault() -> None:
    reference = HealthyFriction(0.9, 0.01, 0.02, 10)
    found = reference.judge(0.8)
    assert found.value == pytest.approx((0.8 / 0.9 - 1) / 2)
    assert found.interval95[1] < 0
    assert found.verdict == "healthy"


def test_the_interval_is_that_of_one_further_run() -> None:
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(1000):
        healthy = [[StrokeCurrent(value, 0.0)] for value in 1 + 0.05 * rng.normal(size=6)]
        found = HealthyFriction.learn(healthy).judge(1 + 0.05 * rng.normal())
        covered += found.interval95[0] <= 0 <= found.interval95[1]
    # Exact for normal values: 950 of 1,000, standard deviation 7.
    assert abs(covered - 950) < 3 * 7


def test_a_cycle_has_a_wider_interval_than_a_run() -> None:
    reference = HealthyFriction(0.9, 0.01, 0.03, 10)
    assert reference.judge(0.98).verdict == "degraded"
    assert reference.judge(0.98, single_cycle=True).verdict != "degraded"


def test_recordings_without_current_or_both_directions_are_refused() -> None:
    one = runs(Rig(), 1, seed=2)[0][0]
    rest = {name: values for name, values in one.channels.items() if name != "current_A"}
    with pytest.raises(RecordingError, match="no current_A"):
        StrokeCurrent.of(Recording(rest))
    upwards = {**one.channels, "command_rad": np.linspace(0.02, 0.14, COMMAND.size)}
    with pytest.raises(RecordingError, match="does not move in both directions"):
        StrokeCurrent.of(Recording(upwards))
    with pytest.raises(RecordingError, match="2 healthy runs at this load"):
        HealthyFriction.learn([[StrokeCurrent(1.0, 0.0)]] * 2)
