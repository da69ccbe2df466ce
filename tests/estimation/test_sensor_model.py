"""Described sensors: they act on simulated recordings, and on the outputs of the model."""

from typing import Any

import numpy as np
import pytest

from cases import THESIS, USUAL
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.sensors import Sensor, Sensors
from emaphm.diagnosis import diagnose, error_percent
from emaphm.errors import MethodError
from emaphm.estimation import replay
from emaphm.estimation.objective import faults_objective, faults_only_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.rows.initial_state import initial_state
from emaphm.estimation.sensors.sensor_model import with_unknown_errors
from emaphm.recording import Recording
from emaphm.recording.noise import noise_level
from emaphm.simulated_recording import simulate
from emaphm.simulation.laws.sensors import sensed

SHORT = Faults(short_b=0.3)


def rig(**sensors: Sensor) -> Actuator:
    return THESIS.model_copy(update={"sensors": Sensors(**sensors)})


def simulated(actuator: Actuator, **options: Any) -> Recording:
    return simulate(actuator, Chirp(), **({"model": "averaged"} | options))


LATE = Sensor(lag=1e-3, delay=3e-4, scale=0.02, offset=-0.1, unsigned=True)


def test_described_sensors_act_on_simulated_channels() -> None:
    true, shown = simulated(THESIS), simulated(rig(current_A=LATE, speed_rad_s=Sensor(lag=2e-2)))
    interval = true.interval_s
    np.testing.assert_allclose(shown["current_A"], sensed(true["current_A"], LATE, interval))
    np.testing.assert_allclose(shown["speed_rad_s"], sensed(true["speed_rad_s"], Sensor(lag=2e-2), interval))
    # Sensors are outside the control loop: the other channels are identical bit by bit.
    np.testing.assert_array_equal(shown["position_rad"], true["position_rad"])


def test_noise_is_added_before_rounding() -> None:
    sensor = Sensor(noise=0.2, resolution=0.5)
    true, shown = simulated(THESIS)["current_A"], simulated(rig(current_A=sensor))["current_A"]
    np.testing.assert_allclose(shown / 0.5, np.round(shown / 0.5), atol=1e-9)
    error = shown - true
    # Variances of noise and rounding add; four standard errors of 2,500 rows.
    assert error.var() == pytest.approx(sensor.noise_variance, rel=4 * (2 / error.size) ** 0.5)
    other = simulated(rig(current_A=sensor), seed=1)["current_A"]
    assert np.any(other != shown)


def test_a_replay_applies_described_sensors_to_the_model() -> None:
    sensors = {"current_A": LATE, "speed_rad_s": Sensor(lag=2e-2), "position_rad": Sensor(delay=5e-3)}
    recording = simulated(rig(**sensors), sampling="instant", sample_rate=20_000.0)
    known, unknown = replay(recording, rig(**sensors)), replay(recording, THESIS)
    for name in sensors:
        assert known.relative_error[name] < 1e-6
        assert unknown.relative_error[name] > 0.05


@pytest.mark.parametrize(
    "sensor",
    [Sensor(unsigned=True), Sensor(lag=5e-4), Sensor(delay=1e-3), Sensor(scale=0.1, offset=0.3)],
    ids=["magnitude", "lag", "delay", "errors"],
)
def test_a_short_is_estimated_with_a_described_sensor(sensor: Sensor) -> None:
    actuator = rig(current_A=sensor)
    command = Chirp(duration=0.2)
    whole = simulate(actuator, command, duration=0.2, faults=SHORT, noise=0.05)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")})
    # The same bound as without sensor errors (docs/physics.md, section 10).
    assert error_percent(SHORT.vector, diagnose(recording, actuator, nuisances=USUAL).faults.vector) <= 2.0


def test_unknown_errors_act_after_described_ones() -> None:
    actuator = rig(current_A=Sensor(offset=1.0, unsigned=True))
    problem = problem_of(simulated(actuator), actuator)
    objective = faults_objective(problem, ["current_offset", "current_scale"])
    point = objective.space.points(SHORT.vector)
    point[-2:] = 0.3, -0.2
    values = objective.space.nuisance_values(point[np.newaxis])
    assert values.keys() == {"current_offset", "current_scale"}
    shown = problem.predict_primary(SHORT.vector)
    expected = (1 + values["current_scale"]) * shown + values["current_offset"]
    np.testing.assert_allclose(objective.outputs(point[np.newaxis])[:, : problem.samples], expected)
    np.testing.assert_allclose(objective.primary_outputs(point[np.newaxis]), expected)


def test_described_noise_replaces_measured_noise() -> None:
    recording = simulated(THESIS, noise=0.3)
    assert problem_of(recording, THESIS).noise == noise_level(recording["current_A"])
    described = problem_of(recording, rig(current_A=Sensor(noise=0.3, resolution=0.1)))
    assert described.noise == pytest.approx((0.3**2 + 0.1**2 / 12) ** 0.5)


def test_the_residual_counts_as_no_smaller_than_the_sensor_noise() -> None:
    recording = simulated(THESIS)
    actuator = rig(current_A=Sensor(noise=0.3))
    objective = faults_only_objective(problem_of(recording, actuator))
    perfect = objective.reweighted(np.zeros(objective.target.size))
    assert perfect.residual_rms == pytest.approx(0.3)


def test_a_manoeuvre_starts_at_the_true_position() -> None:
    rows = np.full(100, 1e-3)
    sensor = Sensor(scale=1.0, offset=0.05)
    given = {"time_s": np.arange(100) / 5e3, "command_rad": rows, "position_rad": 2 * 0.02 + 0.05 + 0 * rows}
    start = initial_state(Recording(given), rig(position_rad=sensor))
    assert start.angle * THESIS.mechanics.gear_ratio == pytest.approx(0.02)


def test_a_delay_as_long_as_the_recording_is_refused() -> None:
    with pytest.raises(MethodError, match="correct it under"):
        replay(simulated(THESIS), rig(current_A=Sensor(delay=0.5)))


def errors_of(**values: float) -> dict[str, Any]:
    return {name: np.array([value]) for name, value in values.items()}


def test_errors_of_the_sensors_act_on_their_own_channel() -> None:
    time = np.arange(200) / 1e3
    signals = np.stack([np.sin(20 * time), np.cos(20 * time)])[np.newaxis]
    measured = {"current_A": np.zeros(200), "voltage_V": np.zeros(200)}
    errors = errors_of(voltage_scale=-2.0, voltage_offset=0.3, voltage_drift=0.5, position_scale=1.0)
    shown = with_unknown_errors(signals.copy(), ("current_A", "voltage_V"), errors, measured, 1e-3)
    np.testing.assert_array_equal(shown[0, 0], signals[0, 0])
    np.testing.assert_allclose(shown[0, 1], -signals[0, 1] + 0.3 + 0.5 * np.arange(200) / 199)


@pytest.mark.parametrize("delay", [2.5e-3, 1e-4, -3.7e-3])
def test_a_delay_moves_a_channel_either_way(delay: float) -> None:
    # A sine of 3 Hz that begins at rest in its trough: between rows of 1 ms a cubic is exact to 1e-7.
    def sine(t: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return np.asarray(-np.cos(20 * np.maximum(t, 0.0)))

    time = np.arange(300) / 1e3
    measured = {"current_A": np.full(300, 7.0)}
    errors = errors_of(delay=delay / 2, current_delay=delay / 2)
    shown = with_unknown_errors(sine(time)[np.newaxis, np.newaxis], ("current_A",), errors, measured, 1e-3)
    known = time - delay < time[-2]
    np.testing.assert_allclose(shown[0, 0][known], sine(time - delay)[known], atol=2e-5)
    # After the end of the recording, an early channel has the measured values.
    beyond = time - delay > time[-1] + 1e-9
    np.testing.assert_array_equal(shown[0, 0][beyond], 7.0)


def test_points_that_differ_in_sensor_errors_share_one_run() -> None:
    problem = problem_of(simulated(THESIS), THESIS)
    objective = faults_objective(problem, ["current_offset", "delay"])
    points = np.tile(objective.space.points(SHORT.vector), (5, 1))
    points[:, -1] = np.linspace(-0.1, 0.1, 5)
    alone = [objective.outputs(point[np.newaxis])[0] for point in points]
    before = problem.runs.of(problem.model)[0]
    # In a batch with early channels, a delay is taken from another row: rounding differs.
    np.testing.assert_allclose(objective.outputs(points), alone, rtol=0, atol=1e-9)
    assert problem.runs.of(problem.model)[0] == before + 1


def test_ignored_rows_have_no_residual() -> None:
    recording = simulated(THESIS)
    spoilt = np.zeros(recording.samples, bool)
    spoilt[100:200] = True
    objective = faults_objective(problem_of(recording, THESIS), ()).ignoring({"current_A": spoilt})
    residual = objective.residual(objective.space.points(SHORT.vector))
    assert not residual[:2500][spoilt].any()
    assert residual[:2500][~spoilt].any()
