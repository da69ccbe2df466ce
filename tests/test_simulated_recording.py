"""Simulated recordings: channels, units, noise, converters and refusals."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emaphm.actuator import Actuator, Chirp, Faults, Ramp, Sampled, Sine, Step
from emaphm.errors import EmaphmError, MethodError, RecordingError, SignalError
from emaphm.recording import Recording, equivalent_current, full_scales
from emaphm.simulated_recording import MOST_STEPS, simulate
from emaphm.simulation import MODELS

THESIS = Actuator.thesis()
IDEAL = Actuator.from_dict(THESIS.model_dump() | {"electrical": None})
RATIO = THESIS.mechanics.gear_ratio

COMMON = {
    "time_s",
    "command_rad",
    "position_rad",
    "speed_rad_s",
    "angle_rad",
    "current_A",
    "voltage_V",
    "torque_Nm",
    "reference_current_A",
}
PHASES = {"current_a_A", "current_b_A", "current_c_A"}
REFERENCE_ONLY = PHASES | {
    "voltage_a_V",
    "voltage_b_V",
    "voltage_c_V",
    "current_active_A",
    "current_magnitude_A",
}

EACH_MODEL = pytest.mark.parametrize("model", list(MODELS))


def quick(**options: Any) -> Recording:
    """Return a tenth of a second of the averaged model."""
    arguments: dict[str, Any] = {"command": Chirp(), "model": "averaged", "duration": 0.1}
    return simulate(THESIS, **(arguments | options))


@pytest.fixture(scope="module")
def default_recordings() -> dict[str, Recording]:
    """Return the default manoeuvre, by model."""
    return {model: simulate(THESIS, Chirp(), model=model) for model in MODELS}


@EACH_MODEL
def test_the_columns_are_those_of_the_model(default_recordings: dict[str, Recording], model: str) -> None:
    assert set(default_recordings[model]) == COMMON | (REFERENCE_ONLY if model == "reference" else set())
    assert default_recordings[model].source == f"simulated ({model} model)"


@EACH_MODEL
def test_the_columns_are_in_their_units(default_recordings: dict[str, Recording], model: str) -> None:
    recording = default_recordings[model]
    assert np.abs(recording["command_rad"]).max() == pytest.approx(5e-3, rel=1e-3)
    # The loop follows 15 Hz with a lag set by its gain of 200 1/s at the user: a few tenths of 5 mrad.
    assert np.abs(recording["position_rad"] - recording["command_rad"]).max() < 3e-3
    assert np.abs(recording["position_rad"]).max() > 4e-3
    # The motor side of the gear is within the gap.
    apart = np.abs(recording["angle_rad"] - recording["position_rad"] / RATIO)
    assert apart.max() <= THESIS.mechanics.backlash / 2 + 1e-9
    # Between means over 0.2 ms, the angle changes by the mean of the neighbouring speeds.
    moved = np.diff(recording["angle_rad"]) / recording.interval_s
    between = (recording["speed_rad_s"][1:] + recording["speed_rad_s"][:-1]) / 2
    np.testing.assert_allclose(moved, between, rtol=0, atol=0.02 * np.abs(between).max())
    assert np.abs(recording["current_A"]).max() < THESIS.controller.current_limit
    assert np.abs(recording["voltage_V"]).max() <= 48 * (1 + 1e-9)
    # Torque is k_t times the equivalent current: exactly for one winding, by definition for three.
    torque = THESIS.motor.torque_constant * recording["current_A"]
    np.testing.assert_allclose(recording["torque_Nm"], torque, rtol=0, atol=1e-9)


@EACH_MODEL
def test_torque_and_speed_agree_with_friction_and_inertia(
    default_recordings: dict[str, Recording], model: str
) -> None:
    # J dw/dt = T - C w - friction: torque and speed of a recording must agree with friction and inertia.
    recording = default_recordings[model]
    speed, torque = recording["speed_rad_s"], recording["torque_Nm"]
    slope = np.gradient(speed, recording.interval_s)
    moving = np.abs(speed) > 20
    unknown = np.stack([slope, np.sign(speed), np.ones_like(speed)])[:, moving]
    inertia, friction, offset = np.linalg.lstsq(unknown.T, torque[moving], rcond=None)[0]
    mechanics = THESIS.mechanics
    assert inertia == pytest.approx(mechanics.inertia, rel=0.05)
    # Viscous friction of some 1e-5 × 100 rad/s is 1 % of it.
    assert friction == pytest.approx(mechanics.dynamic_friction, rel=0.05)
    assert offset == pytest.approx(0, abs=0.05 * mechanics.dynamic_friction)


def test_three_phases_sum_to_zero_and_make_the_equivalent_current(
    default_recordings: dict[str, Recording],
) -> None:
    recording = default_recordings["reference"]
    phases = np.stack([recording[name] for name in sorted(PHASES)])
    np.testing.assert_allclose(phases.sum(axis=0), 0, atol=1e-9)
    from_means = equivalent_current(phases, recording["angle_rad"], 2)
    # On the ramp of a phase, the shape at the mean angle is not the mean shape: 1.5 degrees per interval.
    assert np.sqrt(np.mean((from_means - recording["current_A"]) ** 2)) < 0.1


def test_an_ideal_current_loop_has_no_voltage() -> None:
    recording = simulate(IDEAL, Chirp(), model="averaged", duration=0.1)
    assert set(recording) == COMMON - {"voltage_V"}


@EACH_MODEL
@pytest.mark.parametrize(
    ("duration", "rate"), [(0.1, 5000.0), (0.05, 20_000.0), (0.2, 1000.0), (0.03, 3333.0)]
)
def test_duration_and_rate_are_as_requested(model: str, duration: float, rate: float) -> None:
    recording = simulate(THESIS, Ramp(), model=model, duration=duration, sample_rate=rate)
    assert recording.samples == round(duration * rate)
    assert recording.sample_rate_hz == pytest.approx(rate)
    assert recording["time_s"][0] == 0
    assert recording.duration_s == pytest.approx(duration, abs=0.5 / rate)
    assert recording.sampling == "mean"


@pytest.mark.parametrize("model", ["reference", "averaged"])
def test_a_row_is_a_mean_or_an_instant(model: str) -> None:
    ramp = Ramp(0.02)
    means = simulate(THESIS, ramp, model=model, duration=0.05)
    instants = simulate(THESIS, ramp, model=model, duration=0.05, sampling="instant")
    assert (means.sampling, instants.sampling) == ("mean", "instant")
    np.testing.assert_allclose(instants["command_rad"], ramp(instants["time_s"]), rtol=0, atol=1e-15)
    # Half an interval of the ramp, whatever the model's step.
    np.testing.assert_allclose(means["command_rad"] - instants["command_rad"], 0.02 * 2e-4 / 2, rtol=1e-6)


def test_the_command_is_recorded_unchanged() -> None:
    for command in (Sine(3e-3, 4.0), Step(2e-3, 0.02), Ramp(0.01, 0.02), Sampled([0, 0.1], [1e-3, 2e-3])):
        recording = quick(command=command, sampling="instant")
        np.testing.assert_allclose(recording["command_rad"], command(recording["time_s"]), rtol=0, atol=1e-15)


RETRACTED = THESIS.model_copy(
    update={"mechanics": THESIS.mechanics.model_copy(update={"end_stops": (0.0, 1.0)})}
)
"""An actuator whose position counts from one of its end stops."""


@EACH_MODEL
def test_the_motion_about_another_position_equals_that_about_zero(
    default_recordings: dict[str, Recording], model: str
) -> None:
    # An integer number of motor turns, so that the phases are the same as at 0.
    about, times = 40 * 2 * np.pi * RATIO, np.linspace(0.0, 0.5, 50_001)
    sampled = Sampled(times, Chirp(about=about)(times))
    by_name = simulate(RETRACTED, Chirp(about=about), model=model)
    by_file = simulate(RETRACTED, sampled, model=model, initial_position=about)
    for recording in (by_name, by_file):
        np.testing.assert_allclose(
            recording["position_rad"] - about, default_recordings[model]["position_rad"], atol=5e-6
        )
        assert recording["current_A"].std() == pytest.approx(
            default_recordings[model]["current_A"].std(), rel=0.01
        )


@pytest.mark.parametrize("place", [{"command": Chirp(about=-0.1)}, {"initial_position": 1.1}])
def test_a_start_beyond_the_end_stops_is_refused(place: dict[str, Any]) -> None:
    with pytest.raises(SignalError, match=r"beyond the end stops \[0.0, 1.0\]; say where it rests"):
        simulate(RETRACTED, **({"command": Chirp()} | place))


def test_a_fault_changes_the_recording() -> None:
    healthy, rough = quick(), quick(faults=Faults(friction=1.0))
    assert np.array_equal(healthy["command_rad"], rough["command_rad"])
    assert np.mean(np.abs(rough["current_A"])) > 1.5 * np.mean(np.abs(healthy["current_A"]))


@pytest.mark.parametrize("load", [0.05, lambda t: 0.05 + 0 * t, Sampled([0.0, 1.0], [0.05, 0.05])])
def test_a_load_is_recorded(load: Any) -> None:
    recording = quick(load=load)
    np.testing.assert_allclose(recording["load_Nm"], 0.05, rtol=1e-12)
    assert "load_Nm" not in quick()
    # The load acts against the motor: 0.05 N·m / 0.0752 N·m/A more current on average.
    more = recording["current_A"][100:] - quick()["current_A"][100:]
    assert more.mean() == pytest.approx(0.05 / 0.0752, rel=0.1)


def test_a_changing_load_is_recorded_as_its_means() -> None:
    recording = quick(load=lambda t: 0.1 * t)
    np.testing.assert_allclose(recording["load_Nm"], 0.1 * (recording["time_s"] + 1e-4), rtol=0, atol=1e-12)


def test_noise_is_only_on_the_recorded_currents() -> None:
    options: dict[str, Any] = {"duration": 0.2, "seed": 3}
    clean = simulate(THESIS, Chirp(), **options)
    noisy = simulate(THESIS, Chirp(), noise=0.2, **options)
    for name in clean:
        difference = noisy[name] - clean[name]
        if name in PHASES | {"current_A"}:
            # With 1,000 rows, an rms is accurate to 1 / sqrt(2000) = 2 %.
            assert np.sqrt(np.mean(difference**2)) == pytest.approx(0.2, rel=0.08)
        else:
            assert not difference.any()


def test_converters_have_the_requested_resolution() -> None:
    clean, coarse = quick(), quick(adc_bits=10)
    scales = full_scales(THESIS)
    for name in ("current_A", "position_rad", "speed_rad_s", "voltage_V"):
        step = 2 * scales[name] / 2**10
        np.testing.assert_allclose(coarse[name] / step, np.round(coarse[name] / step), rtol=0, atol=1e-6)
        assert np.abs(coarse[name] - clean[name]).max() <= step / 2 * (1 + 1e-9)
    np.testing.assert_array_equal(coarse["command_rad"], clean["command_rad"])


def test_the_noise_of_the_thesis_is_inside_the_loop() -> None:
    quiet, loud = (
        simulate(THESIS, Chirp(), duration=0.1, controller_noise=rms, seed=1) for rms in (0.0, 0.3)
    )
    difference = loud["reference_current_A"] - quiet["reference_current_A"]
    # White at each microsecond: the mean of 200 steps has 0.3 / sqrt(200), plus the effect of the loop.
    assert 0.5 * 0.3 / np.sqrt(200) < np.sqrt(np.mean(difference**2)) < 0.3
    np.testing.assert_allclose(loud["position_rad"], quiet["position_rad"], rtol=0, atol=2e-5)


@pytest.mark.parametrize("option", [{"noise": 0.1}, {"controller_noise": 0.1}])
def test_only_the_same_seed_gives_the_same_bits(option: dict[str, float]) -> None:
    def recorded(seed: int) -> Recording:
        return simulate(THESIS, Chirp(), duration=0.05, seed=seed, **option)  # type: ignore[arg-type]

    first, second, third = recorded(5), recorded(5), recorded(6)
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])
    assert not np.array_equal(first["current_A"], third["current_A"])


@given(amplitude=st.floats(1e-4, 0.5), frequency=st.floats(0.1, 50), level=st.floats(-0.3, 0.3))
@settings(max_examples=25)
def test_all_commands_are_followed_within_the_limits(
    amplitude: float, frequency: float, level: float
) -> None:
    recording = quick(command=Sine(amplitude, frequency), load=level)
    mechanics, controller = THESIS.mechanics, THESIS.controller
    assert mechanics.end_stops is not None
    assert np.abs(recording["position_rad"]).max() <= mechanics.end_stops[1] + mechanics.backlash * RATIO
    assert np.abs(recording["current_A"]).max() <= controller.current_limit
    assert np.abs(recording["torque_Nm"]).max() <= (THESIS.motor.torque_limit or np.inf) * (1 + 1e-12)


# Refusals.


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"duration": 0.0}, SignalError, r"duration \(0 s\) and sample rate \(5000 Hz\) must be above 0"),
        ({"duration": -1.0}, SignalError, "must be above 0"),
        ({"duration": np.nan}, SignalError, "must be above 0"),
        ({"duration": np.inf}, SignalError, "must be above 0"),
        ({"sample_rate": 0.0}, SignalError, "must be above 0"),
        ({"sample_rate": np.nan}, SignalError, "must be above 0"),
        (
            {"duration": 1e9},
            SignalError,
            r"1e\+09 s are too long for the averaged model; 15000 s are possible",
        ),
        ({"duration": 400.0, "model": "reference"}, SignalError, "400 s are too long .* 300 s are possible"),
        ({"duration": 3.0, "sample_rate": 1e7}, SignalError, r"3e\+07 rows are too many"),
        ({"duration": 1e-3}, RecordingError, "too short: 5 rows, at least 50"),
        ({"controller_noise": 0.1}, MethodError, "averaged model's controller has no noise"),
        (
            {"controller_noise": 0.1, "model": "monitor"},
            MethodError,
            "monitor model's controller has no noise",
        ),
        ({"controller_noise": -0.1, "model": "reference"}, SignalError, "give 0 or more"),
        ({"model": "refrence"}, MethodError, r"did you mean 'reference'"),
        ({"noise": -0.1}, RecordingError, "give 0 or more"),
        ({"noise": np.nan}, RecordingError, "give 0 or more"),
        ({"adc_bits": 99}, RecordingError, "99 bits"),
        ({"command": Ramp(0.0)}, RecordingError, "nothing was commanded"),
        ({"command": lambda t: np.where(t > 0.05, np.nan, 1e-3)}, SignalError, "command is not finite"),
        ({"load": np.nan}, SignalError, "load is not finite"),
    ],
)
def test_impossible_arguments_are_refused(
    options: dict[str, Any], error: type[EmaphmError], message: str
) -> None:
    with pytest.raises(error, match=message) as caught:
        quick(**options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("option", [{"noise": 0.1}, {"controller_noise": 0.1, "model": "reference"}])
def test_a_negative_seed_is_refused(option: dict[str, Any]) -> None:
    with pytest.raises(EmaphmError, match="seed"):
        quick(seed=-1, **option)


def test_a_run_with_too_many_steps_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("emaphm.simulated_recording.MOST_STEPS", 1000)
    assert MOST_STEPS > 1000
    assert quick(duration=0.05).samples == 250
    with pytest.raises(SignalError, match="too long"):
        quick(duration=0.0501)


def test_the_monitor_model_needs_windings() -> None:
    with pytest.raises(MethodError, match="has no drive of kind 'current'; it has hysteresis"):
        simulate(IDEAL, Chirp(), model="monitor")
