"""The learned error of a model: synthetic errors of known size and correlation, and diagnoses that use it."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.law_sections import Drive
from emaphm.actuator.unit.model_error import NOT_LEARNED, ApparentFaults, ChannelError, ModelError
from emaphm.arrays import Array
from emaphm.calibration import calibrate
from emaphm.calibration.model_error.learned import HeldOutResidual, channel_error
from emaphm.calibration.text import model_error_notes
from emaphm.diagnosis import diagnose
from emaphm.diagnosis.verdict import OF_MODEL_ERROR, VERDICT
from emaphm.errors import ActuatorError
from emaphm.estimation.uncertainty.correlation import integral_time, white_noise
from emaphm.estimation.uncertainty.model_error import largest_healthy_ratio
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.study import foreign_plant
from emaphm.study.rig import ForeignFeatures, Stribeck

INTERVAL = 1e-3
ROWS = 4000

DECAY = 0.97
"""Decay of an oscillation from one row to the next."""


def autoregressive(memory_s: float, rows: int, rng: np.random.Generator) -> Array:
    """Return a series of variance 1 with the correlation exp(-t / memory_s), from its definition."""
    share = float(np.exp(-INTERVAL / memory_s))
    values = np.empty(rows)
    values[0] = rng.normal()
    for i, new in enumerate(rng.normal(0.0, (1 - share**2) ** 0.5, rows - 1)):
        values[i + 1] = share * values[i] + new
    return values


def terms(rng: np.random.Generator) -> Array:
    """Return the terms of the variance, (4, rows), of a motor with oscillating speed and no load."""
    time = INTERVAL * np.arange(ROWS)
    speed = 50 * np.sin(2 * np.pi * rng.uniform(0.5, 1.0) * time)
    return np.stack([np.ones(ROWS), speed**2, np.zeros(ROWS), np.gradient(speed, INTERVAL) ** 2])


@pytest.mark.parametrize("memory_s", [0.0, 5e-3, 20e-3])
def test_the_integral_time_is_that_of_the_process(memory_s: float) -> None:
    rng = np.random.default_rng(1)
    series = [autoregressive(memory_s, ROWS, rng) if memory_s else rng.normal(size=ROWS) for _ in range(3)]
    share = float(np.exp(-INTERVAL / memory_s)) if memory_s else 0.0
    true = INTERVAL * (1 + share) / (1 - share)
    # The peak of a spectrum from so few rows, minus its expected random part, is within a factor of 2.
    assert true / 2 < integral_time(series, [INTERVAL] * 3) < 2 * true
    assert integral_time(series, [INTERVAL] * 3) >= INTERVAL


@pytest.mark.parametrize("seconds", [(2.0, 2.0, 2.0, 2.0), (1.0, 1.6, 2.4, 4.0)])
@pytest.mark.parametrize("frequency", [80.0, 300.0])
def test_the_integral_time_of_an_oscillation_is_right_for_any_lengths(
    seconds: tuple[float, ...], frequency: float
) -> None:
    turn = 2 * np.pi * frequency * INTERVAL
    # For an autoregressive process of second order: the peak of its spectrum over its variance.
    angles = np.linspace(0, np.pi, 100_001)
    filtered = 1 - 2 * DECAY * np.cos(turn) * np.exp(-1j * angles) + DECAY**2 * np.exp(-2j * angles)
    true = INTERVAL * np.max(np.abs(filtered) ** -2) / np.mean(np.abs(filtered) ** -2)
    estimates = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        drawn = [rng.normal(size=round(s / INTERVAL) + 1000) for s in seconds]
        series = [lfilter([1], [1, -2 * DECAY * np.cos(turn), DECAY**2], noise)[1000:] for noise in drawn]
        estimates.append(integral_time(series, [INTERVAL] * 4))
    assert 0.7 * true < np.median(estimates) < 1.5 * true


def test_the_integral_time_of_a_constant_is_half_its_length() -> None:
    # The length minus the standard error of a spectrum with 2 degrees of freedom, which equals its value.
    assert integral_time([np.ones(ROWS)], [INTERVAL]) == pytest.approx(ROWS * INTERVAL / 2)


def test_white_noise_is_separated_from_a_slow_error() -> None:
    rng = np.random.default_rng(2)
    residual = rng.normal(0.0, 0.3, ROWS) + autoregressive(0.1, ROWS, rng)
    # Bands of 500 rows each; the slow error is negligible in the last band.
    assert white_noise(residual) == pytest.approx(0.3, rel=0.15)


def test_an_error_that_grows_with_speed_is_separated_from_a_constant_one() -> None:
    rng = np.random.default_rng(3)
    left_out = []
    for _ in range(3):
        rows = terms(rng)
        deviation = np.sqrt(0.1**2 + (0.02 * np.sqrt(rows[1])) ** 2)
        left_out.append(HeldOutResidual(deviation * autoregressive(3e-3, ROWS, rng), 0.0, rows, INTERVAL))
    error = channel_error(left_out)
    assert error.speed == pytest.approx(0.02, rel=0.3)
    # The floor has at least a minimum share of the variance.
    assert 0.05 < error.floor < 0.35
    assert error.load == 0.0
    assert error.recordings == 3
    # 600 independent sections of 2 T in each recording: their rms values agree within some percent.
    assert error.scatter < 0.1


def test_noise_is_not_attributed_to_the_model() -> None:
    rng = np.random.default_rng(4)
    left_out = [HeldOutResidual(rng.normal(0.0, 1.0, ROWS), 1.0, terms(rng), INTERVAL) for _ in range(3)]
    error = channel_error(left_out)
    # A hundredth of the variance is attributed to the model.
    assert error.floor <= 0.2


def test_recordings_that_differ_by_rounding_have_no_scatter() -> None:
    rng = np.random.default_rng(5)
    rows, residual = terms(rng), rng.normal(size=ROWS)
    for ulps in range(1, 40):
        # Rounding errors between two equal recordings, on any processor.
        other = residual * (1 + ulps * np.finfo(float).eps)
        left_out = [HeldOutResidual(values, 0.0, rows, INTERVAL) for values in (residual, other)]
        assert channel_error(left_out).scatter == 0.0


def test_the_largest_healthy_ratio_grows_with_the_scatter_of_recordings() -> None:
    def bound(scatter: float, recordings: int) -> float:
        error = ChannelError(floor=1.0, correlation_time=1e-3, scatter=scatter, recordings=recordings)
        return largest_healthy_ratio(error)

    # Student's t at 95 % is 2.92 for 2 degrees of freedom, and 1.70 for 29 (tables).
    assert bound(0.1, 3) == pytest.approx(np.exp(2.920 * 0.1 * (4 / 3) ** 0.5), rel=1e-3)
    assert bound(0.1, 30) == pytest.approx(np.exp(1.699 * 0.1 * (31 / 30) ** 0.5), rel=1e-3)
    assert bound(0.0, 3) == 1.1
    assert bound(1.0, 2) == 3.0


def test_a_model_error_is_written_with_units_and_read_back(tmp_path: Path) -> None:
    error = ChannelError(floor=0.2, speed=1e-3, correlation_time=0.01, scatter=0.05, recordings=3)
    learned = THESIS.model_copy(update={"model_error": ModelError(current_A=error)})
    path = tmp_path / "unit.toml"
    learned.to_toml(path)
    assert Actuator.from_toml(path) == learned
    text = path.read_text(encoding="utf-8")
    assert "[model_error.current_A]" in text
    assert "floor = 0.2 # unit of the channel: rms at rest" in text
    THESIS.to_toml(path)
    assert "model_error" not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("toml", "pieces"),
    [
        ("[model_error.curent_A]\nfloor = 0.1", ("model_error.curent_A", "did you mean 'current_A'?")),
        (
            "[model_error.current_A]\nfloor = 0.1\ncorrelation_time = 0.0\nscatter = 0.1\nrecordings = 3",
            ("model_error.current_A.correlation_time", "greater than 0"),
        ),
        (
            "[model_error.current_A]\nfloor = 0.1\ncorrelation_time = 0.1\nscatter = 0.1\nrecordings = 1",
            ("model_error.current_A.recordings", "greater than or equal to 2"),
        ),
        (
            "[model_error.current_A]\nfloor = 0.0\ncorrelation_time = 0.1\nscatter = 0.1\nrecordings = 3",
            ("model_error.current_A", "give floor > 0"),
        ),
    ],
)
def test_impossible_model_errors_are_refused(toml: str, pieces: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "unit.toml"
    THESIS.to_toml(path)
    path.write_text(path.read_text(encoding="utf-8") + "\n" + toml + "\n", encoding="utf-8")
    with pytest.raises(ActuatorError) as caught:
        Actuator.from_toml(path)
    for piece in pieces:
        assert piece in str(caught.value)


# A plant with undescribed smooth friction: the error of the model is learned from three healthy recordings.

SMOOTH = ForeignFeatures(friction=Stribeck(speed=20.0, smoothing=1.0))
FREE = ("inertia", "viscous", "coulomb")


def recorded(seed: int, faults: Faults = Faults()) -> Recording:  # noqa: B008 - frozen
    command = Chirp(duration=0.15)
    whole = foreign_plant.simulate(
        THESIS, command, SMOOTH, faults=faults, duration=0.15, noise=0.05, adc_bits=12, seed=seed
    )
    kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")}
    return Recording(kept, whole.sampling, f"day {seed}")


@pytest.fixture(scope="module")
def unit() -> Actuator:
    # Without correction, in a tenth of the time: the error of the current is within 2 % of that with it.
    days = [recorded(seed) for seed in range(3)]
    return calibrate(days, THESIS, FREE, max_corrections=0, workers=1).actuator


def test_a_healthy_recording_of_an_unmodelled_plant_is_explained_by_the_model_error(unit: Actuator) -> None:
    diagnosis = diagnose(recorded(10), unit, nuisances=THESIS.nuisances.estimated, workers=1)
    assert diagnosis.explained
    for component in diagnosis.components.values():
        assert component.verdict != "degraded"
    compared = diagnosis.model_error["current_A"]
    assert compared.ratio == pytest.approx(1.0, abs=0.15)
    assert compared.recordings == 3
    assert compared.rank_confidence == 0.75
    assert "3 healthy recordings left out of the calibration" in "\n".join(diagnosis.notes())
    assert diagnosis.to_dict()["model_error"]["current_A"]["as_healthy"] is True


def test_noise_beyond_that_of_healthy_recordings_is_not_explained(unit: Actuator) -> None:
    noisy = recorded(12)
    rng = np.random.default_rng(6)
    columns = {name: noisy[name] for name in noisy}
    columns["current_A"] = rng.normal(0.0, 3.0, noisy.samples)
    estimated = THESIS.nuisances.estimated
    diagnosis = diagnose(Recording(columns), unit, nuisances=estimated, max_corrections=0, workers=1)
    assert not diagnosis.explained
    assert diagnosis.model_error["current_A"].ratio > 3


@pytest.mark.usefixtures("one_search", "unrefined")
def test_without_the_model_error_that_recording_is_not_explained(unit: Actuator) -> None:
    bare = unit.model_copy(update={"model_error": NOT_LEARNED})
    diagnosis = diagnose(recorded(10), bare, nuisances=THESIS.nuisances.estimated, workers=1)
    assert not diagnosis.explained
    assert diagnosis.model_error == {}


def test_a_large_fault_is_detected_with_a_model_error(unit: Actuator) -> None:
    faulty = recorded(11, Faults(short_a=0.4))
    diagnosis = diagnose(faulty, unit, nuisances=THESIS.nuisances.estimated, workers=1)
    low, high = diagnosis.interval["short_a"]
    assert VERDICT.healthy_margin < low < 0.4 < high


def test_no_model_error_is_learned_from_one_recording() -> None:
    calibration = calibrate([recorded(0)], THESIS, FREE, workers=1, max_corrections=0)
    assert calibration.actuator.model_error == NOT_LEARNED


def test_the_ripple_that_faults_add_is_no_reason_against_an_estimate() -> None:
    # Values learned by a calibration with three healthy recordings of this plant: lag and model error.
    current = ChannelError(floor=0.035, noise=0.057, correlation_time=1e-3, scatter=0.02, recordings=3)
    voltage = ChannelError(floor=1.9, noise=1.5, correlation_time=2.7e-3, scatter=0.033, recordings=3)
    drive = Drive(kind="hysteresis", current_lag=22.6e-6)
    learned = ModelError(current_A=current, voltage_V=voltage)
    unit = THESIS.model_copy(update={"drive": drive, "model_error": learned})
    faults = Faults(friction=0.3, short_c=0.6, eccentricity=0.8, eccentricity_phase=0.4)
    command, lagging = Chirp(duration=0.3), ForeignFeatures(sensor_lag=20e-6)
    whole = foreign_plant.simulate(
        THESIS, command, lagging, faults=faults, duration=0.3, noise=0.05, adc_bits=12
    )
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})
    diagnosis = diagnose(recording, unit, nuisances=("load",), workers=1)
    assert diagnosis.explained
    assert np.abs(diagnosis.faults.vector - faults.vector).max() < 0.05


def test_the_reason_names_the_model_error_where_it_makes_a_verdict_undecided() -> None:
    # The recording identifies these to some hundredths; the rest of the interval is by the calibration.
    whole = simulate(THESIS, Chirp(duration=0.2), faults=Faults(short_b=0.15), duration=0.2, noise=0.05)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})
    poor = ModelError(faults=ApparentFaults(short_b=0.1, gain=0.3, recordings=3))
    diagnosis = diagnose(recording, THESIS.model_copy(update={"model_error": poor}))
    for name in ("short_b", "gain"):
        assert diagnosis.components[name].verdict == "cannot tell"
        assert diagnosis.components[name].reason == OF_MODEL_ERROR
    assert OF_MODEL_ERROR not in {
        diagnosis.components[name].reason for name in ("friction", "backlash", "short_a")
    }


@pytest.mark.parametrize(("apparent", "said"), [(0.05, False), (0.15, True)])
def test_a_model_error_that_hides_faults_has_a_note_with_advice(apparent: float, *, said: bool) -> None:
    learned = ModelError(faults=ApparentFaults(gain=apparent, recordings=3))
    for laws_tried, advice in (
        (False, "Let laws be tried (--laws auto)"),
        (True, "Calibrate on more manoeuvres"),
    ):
        lines = model_error_notes(learned, "rotary", laws_tried=laws_tried)
        # Student's t for three degrees of freedom: 3.18 standard deviations.
        notes = [line for line in lines if "Faults up to some 0.5 may not be found" in line]
        assert [advice in line for line in notes] == [True] * said
