"""Baselines: calibration by healthy recordings of a unit, and diagnoses with the baseline as a prior."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cases import THESIS, USUAL
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.actuator.unit.baseline import Baseline
from emaphm.calibration import Calibration, calibrate
from emaphm.calibration.warnings.earlier import earlier_warnings
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.errors import MethodError
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.space.nuisances import BASELINE, NuisanceSet
from emaphm.estimation.space.parameter_variation import (
    LEAST_DEVIATION,
    START_FACTOR,
    ParameterVariation,
)
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

VOLTAGE = ("current_A", "voltage_V")
FREE = ("inertia", "viscous", "coulomb", "torque_constant", "resistance")
FACTORS = dict(zip(FREE, (1.08, 0.9, 0.92, 1.04, 0.95), strict=True))
UNIT = with_lumped_parameters(
    THESIS, {n: v * FACTORS[n] for n, v in lumped_parameters(THESIS, FREE).items()}, name="unit 7"
)
DURATION = 0.2
TRUTH = Faults(friction=0.2, short_a=0.15, gain=0.55)


def with_baseline(deviations: Mapping[str, float], actuator: Actuator = THESIS) -> Actuator:
    """Return the description with a baseline of independent parameters with these standard deviations."""
    covariance = np.diag([s**2 for s in deviations.values()])
    baseline = Baseline.of(tuple(deviations), covariance, ("healthy.csv",))
    return actuator.model_copy(update={"baseline": baseline})


def recorded_on_a_day(
    actuator: Actuator,
    *,
    load: float = 0.0,
    temperature_rise_K: float = 0.0,
    faults: Faults = Faults(),  # noqa: B008 - frozen
    channels: tuple[str, ...] = VOLTAGE,
    seed: int = 0,
    stop_hz: float = 15.0,
) -> Recording:
    """Return a recording of a rig; copper gains 0.393 %/K, NdFeB loses 0.11 %/K."""
    cold = lumped_parameters(actuator, ("resistance", "torque_constant"))
    changed = {
        "offset": load,
        "resistance": cold["resistance"] * (1 + 0.00393 * temperature_rise_K),
        "torque_constant": cold["torque_constant"] * (1 - 0.0011 * temperature_rise_K),
    }
    that_day = with_lumped_parameters(actuator, changed)
    command = Chirp(stop_hz=stop_hz, duration=DURATION)
    whole = simulate(that_day, command, duration=DURATION, faults=faults, noise=0.05, adc_bits=12, seed=seed)
    kept = {name: whole[name] for name in ("time_s", "command_rad", *channels)}
    return Recording(kept, whole.sampling, f"day {seed}")


@pytest.fixture(scope="module")
def healthy() -> list[Recording]:
    """Return recordings of the healthy unit on three days that differ in load, temperature and manoeuvre."""
    return [
        recorded_on_a_day(UNIT, load=0.1, temperature_rise_K=20.0, seed=1),
        recorded_on_a_day(UNIT, load=-0.05, temperature_rise_K=-10.0, seed=2, stop_hz=12.0),
        recorded_on_a_day(UNIT, load=0.02, temperature_rise_K=35.0, seed=3),
    ]


@pytest.fixture(scope="module")
def calibrated(healthy: list[Recording]) -> Calibration:
    # One correction only, to save time: the checks below do not need the accuracy of further corrections.
    return calibrate(healthy, THESIS, FREE, max_corrections=1, workers=1)


def warnings_of_recalibration(calibrated: Calibration, recordings: list[Recording]) -> tuple[str, ...]:
    return calibrate(recordings, calibrated.actuator, FREE, max_corrections=0, workers=1).warnings


def test_a_calibration_that_leaves_out_earlier_recordings_has_a_warning(
    calibrated: Calibration, healthy: list[Recording]
) -> None:
    (warning,) = warnings_of_recalibration(calibrated, healthy[:2])
    assert warning.startswith("this calibration takes the place of the one before, by day 3: ")
    assert earlier_warnings(calibrated.actuator, calibrated.actuator) == ()


def test_another_unit_contradicts_the_earlier_calibration(calibrated: Calibration) -> None:
    other = with_lumped_parameters(UNIT, {"inertia": 0.8 * lumped_parameters(UNIT, ("inertia",))["inertia"]})
    warnings = warnings_of_recalibration(calibrated, [recorded_on_a_day(other, seed=5)])
    (contradiction,) = (warning for warning in warnings if "contradicts" in warning)
    assert "by day 1, day 2, day 3" in contradiction
    assert "inertia by " in contradiction


@pytest.fixture(scope="module")
def faulty() -> Recording:
    return recorded_on_a_day(UNIT, load=0.08, temperature_rise_K=15.0, faults=TRUTH, seed=4)


@pytest.fixture(scope="module")
def diagnosed(faulty: Recording, calibrated: Calibration) -> Diagnosis:
    return diagnose(faulty, calibrated.actuator, workers=1)


# Calibration by several recordings.


@pytest.mark.evidence
def test_parameters_are_estimated_under_unknown_loads_and_temperatures(calibrated: Calibration) -> None:
    true = lumped_parameters(UNIT, FREE)
    for name, estimate in calibrated.parameters.items():
        # In one of 3000 cases, one of five normal deviates exceeds 4.
        assert abs(estimate.value - true[name]) < 4 * estimate.standard_error
        assert estimate.identifiable
    # Three temperatures with a standard deviation of 30 K, by the coefficients of copper and magnets.
    relative = {name: p.standard_error / p.value for name, p in calibrated.parameters.items()}
    assert relative["resistance"] == pytest.approx(0.00393 * 30 / 3**0.5, rel=0.25)
    assert relative["torque_constant"] == pytest.approx(0.0011 * 30 / 3**0.5, rel=0.25)
    assert relative["inertia"] < 0.01


def test_the_baseline_has_the_covariance_of_the_calibration(calibrated: Calibration) -> None:
    baseline = calibrated.actuator.baseline
    assert baseline is not None
    assert baseline.names == FREE
    assert baseline.recordings == ("day 1", "day 2", "day 3")
    relative = [p.standard_error / p.value for p in calibrated.parameters.values()]
    np.testing.assert_allclose(np.sqrt(np.diag(baseline.covariance)), relative, rtol=1e-12)
    # Heat raises the resistance and lowers the torque constant.
    rows = np.array(baseline.covariance)
    assert rows[3, 4] / np.sqrt(rows[3, 3] * rows[4, 4]) < -0.8


def test_the_nuisances_of_each_day_are_reported(calibrated: Calibration) -> None:
    loads = [day["load"] for day in calibrated.nuisances]
    # Friction of 0.08 N·m is known to some percent.
    np.testing.assert_allclose(loads, [0.1, -0.05, 0.02], atol=0.01)
    text = str(calibrated)
    assert "Estimated with the parameters in day 2: load -0.0" in text
    assert "The 3 recordings scatter" in text
    # With its load, each recording is explained: 0.1 N·m correspond to half of the rms current.
    assert calibrated.relative_error["current_A"] < 0.1
    assert [recording["recording"] for recording in calibrated.to_dict()["recordings"]] == [
        "day 1",
        "day 2",
        "day 3",
    ]


@pytest.mark.usefixtures("no_model_error")
def test_an_uninformative_recording_does_not_increase_the_errors(healthy: list[Recording]) -> None:
    # The current alone has information on torques in proportion to the torque constant, and no resistance.
    uninformative = recorded_on_a_day(
        UNIT, load=0.1, temperature_rise_K=20.0, channels=("current_A",), seed=5
    )
    # Without correction, which takes a quarter of the time.
    without_uninformative, with_uninformative = (
        calibrate(days, THESIS, FREE, max_corrections=0, workers=1)
        for days in (healthy, [*healthy, uninformative])
    )
    for name in FREE:
        before, after = without_uninformative.parameters[name], with_uninformative.parameters[name]
        assert abs(after.value - before.value) < 2 * before.standard_error
        assert after.standard_error < 1.5 * before.standard_error
    assert with_uninformative.parameters["resistance"].standard_error == pytest.approx(
        without_uninformative.parameters["resistance"].standard_error, rel=0.3
    )
    alone = calibrate(uninformative, THESIS, FREE, max_corrections=0, workers=1)
    assert not any(p.identifiable for p in alone.parameters.values())
    covariance = np.array(alone.actuator.baseline.covariance)  # type: ignore[union-attr]
    ratio = np.array([1.0, 0.0, 0.0, -1.0, 0.0])
    # However, the ratio of inertia to torque constant is known to about 3.3 %, by a temperature of 30 K.
    assert ratio @ covariance @ ratio < 0.06**2


@pytest.mark.usefixtures("no_model_error")
def test_friction_that_differs_from_day_to_day_widens_the_baseline() -> None:
    days = [
        with_lumped_parameters(UNIT, {"coulomb": lumped_parameters(UNIT, ("coulomb",))["coulomb"] * f})
        for f in (0.9, 1.0, 1.1)
    ]
    wandering = [recorded_on_a_day(day, seed=i) for i, day in enumerate(days)]
    steady = [recorded_on_a_day(UNIT, seed=i) for i in range(3)]
    names = ("inertia", "coulomb")
    # Without correction: its bias is common to all days.
    calibrations = [
        calibrate(days, UNIT, names, nuisances=(), max_corrections=0, workers=1)
        for days in (wandering, steady)
    ]
    wide, narrow = (
        c.parameters["coulomb"].standard_error / c.parameters["coulomb"].value for c in calibrations
    )
    assert calibrations[0].birge_ratio is not None
    assert calibrations[0].birge_ratio > 3
    assert "those above include it" in str(calibrations[0])
    # A scatter of 10 % from three values: the error is at least that, and many times that by noise.
    assert wide > 0.1
    assert narrow < 0.02


# Diagnoses with a baseline.


@pytest.mark.parametrize("seed", [0, 1])
def test_axes_and_priors_reproduce_the_covariance(seed: int) -> None:
    names = ("inertia", "coulomb", "offset")
    root = np.random.default_rng(seed).normal(0.0, 0.02, (3, 3)) * np.array([[1.0], [1.0], [0.1]])
    actuator = THESIS.model_copy(update={"baseline": Baseline.of(names, root @ root.T, ("a",))})
    unknown = NuisanceSet.of(actuator, ("load",), ())
    assert unknown.names == ("load", "baseline 1", "baseline 2", "baseline 3")
    assert unknown.quantities == ("load", *(BASELINE + name for name in names))
    prior = unknown.meaning @ np.diag(unknown.priors**2) @ unknown.meaning.T
    np.testing.assert_allclose(prior[1:, 1:], root @ root.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(prior[0, 1:], 0.0)


def test_accurately_known_parameters_are_not_estimated() -> None:
    known = with_baseline({"inertia": 0.9 * LEAST_DEVIATION, "coulomb": 0.5 * LEAST_DEVIATION})
    assert NuisanceSet.of(known, (), ()).names == ()
    half = NuisanceSet.of(with_baseline({"inertia": 0.02, "coulomb": 0.5 * LEAST_DEVIATION}), (), ())
    assert half.names == ("baseline inertia",)


def test_the_prior_of_an_unknown_parameter_is_no_wider_than_that_of_a_description() -> None:
    variation = ParameterVariation.of_unit(with_baseline({"resistance": 3.4}))
    assert np.exp(variation.priors[0]) == pytest.approx(START_FACTOR)


def test_a_baseline_is_combined_with_the_nuisances_of_a_recording() -> None:
    actuator = with_baseline({"inertia": 0.05, "coulomb": 0.04, "offset": 0.01, "resistance": 0.1})
    unknown = NuisanceSet.of(actuator, ("load", "temperature", "inertia"), ())
    point = np.random.default_rng(0).normal(0.0, 0.2, (1, unknown.priors.size)) * unknown.priors
    values = unknown.values(point)
    day = {name: float(value[0]) for name, value in values.items()}
    described = lumped_parameters(actuator, ("coulomb", "inertia", "offset", "resistance", "torque_constant"))
    expected = {
        "coulomb": described["coulomb"] * np.exp(day["baseline coulomb"]),
        "inertia": described["inertia"] * np.exp(day["baseline inertia"]) * (1 + day["inertia"]),
        "offset": described["offset"] + day["baseline offset"] + day["load"],
        "resistance": described["resistance"]
        * np.exp(day["baseline resistance"])
        * (1 + 0.00393 * day["temperature"]),
        "torque_constant": described["torque_constant"] * (1 - 0.0011 * day["temperature"]),
    }
    parameters = {
        name: float(value[0]) for name, value in unknown.lumped_parameters(actuator, values).items()
    }
    assert parameters == pytest.approx(expected, rel=1e-12)


def test_a_deviation_acts_as_a_change_of_lumped_parameters() -> None:
    # The recording of the other actuator equals the output of the described one under the deviation.
    whole = simulate(
        with_lumped_parameters(THESIS, {"inertia": 1.06 * 2.5e-5}), Chirp(), faults=TRUTH, model="averaged"
    )
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")})
    fit = faults_objective(problem_of(recording, with_baseline({"inertia": 0.03}), channels=None), ())
    point = fit.space.points(TRUTH.vector)
    described_rms = np.sqrt(np.mean((fit.target - fit.outputs(point[np.newaxis])[0])[:-1] ** 2))
    point[-1] = np.log(1.06) * np.sign(fit.space.nuisances.meaning[0, 0])
    deviating_rms = np.sqrt(np.mean((fit.target - fit.outputs(point[np.newaxis])[0])[:-1] ** 2))
    # The remaining error is that of the command, which is recorded as means and interpolated.
    assert deviating_rms < 0.2 * described_rms
    assert fit.space.nuisance_values(point[np.newaxis])["baseline inertia"][0] == pytest.approx(np.log(1.06))


def test_friction_is_no_more_accurate_than_its_baseline() -> None:
    # A fault k multiplies all friction by 1 + 2 k: 5 % of healthy friction are an error of 0.025 (1 + 2 k).
    recording = simulate(THESIS, Chirp(duration=0.2), duration=0.2, faults=Faults(friction=0.3), noise=0.05)
    recording = Recording({name: recording[name] for name in ("time_s", "command_rad", *VOLTAGE)})
    frictionless = with_lumped_parameters(THESIS, {"viscous": 0.0})
    loose = diagnose(recording, with_baseline({"coulomb": 0.05}, frictionless), nuisances=(), workers=1)
    exact = diagnose(recording, frictionless, nuisances=(), workers=1)
    assert exact.components["friction"].standard_error < 0.01
    assert loose.components["friction"].standard_error == pytest.approx(0.025 * 1.6, rel=0.15)
    deviation = loose.nuisances["baseline coulomb"]
    assert deviation.standard_error == pytest.approx(0.05, rel=0.15)
    assert not deviation.known
    # The two parameters are collinear.
    covariance = loose.covariance[np.ix_([0, -1], [0, -1])]
    assert abs(covariance[0, 1]) / np.sqrt(covariance[0, 0] * covariance[1, 1]) > 0.95
    assert loose.coordinates[-1] == "baseline coulomb"


def test_a_calibrated_unit_is_diagnosed_without_the_bias_of_its_description(
    faulty: Recording, diagnosed: Diagnosis
) -> None:
    truth = TRUTH.vector
    biased = diagnose(faulty, THESIS, nuisances=USUAL, max_corrections=0, workers=1)
    indices = [i for i in range(8) if i != 6]  # without eccentricity, its direction has no meaning
    calibrated_error, biased_error = (
        np.abs(d.faults.vector - truth)[indices].max() for d in (diagnosed, biased)
    )
    # Units of a kind differ by 8 %, which is 0.04 in friction and in shorts.
    assert calibrated_error < 0.02 < biased_error
    assert diagnosed.explained
    errors = [component.standard_error for component in diagnosed.components.values()]
    # Eight normal estimates are all within four standard errors in 1999 of 2000 cases.
    assert np.all(np.abs(diagnosed.faults.vector - truth)[indices] < 4 * np.array(errors)[indices])


def test_deviations_are_reported_in_text_and_json(diagnosed: Diagnosis) -> None:
    text = str(diagnosed)
    assert "Not identifiable from the recording: inertia, viscous, coulomb" in text
    deviation = replace(
        diagnosed.nuisances[f"{BASELINE}inertia"], value=0.06, standard_error=0.001, known=True
    )
    assert "Deviation of the unit from its description: inertia +6.18 ± 0.11 %." in str(
        replace(diagnosed, nuisances={**diagnosed.nuisances, f"{BASELINE}inertia": deviation})
    )
    names = [BASELINE + name for name in FREE]
    nuisances = diagnosed.to_dict()["nuisances"]
    assert list(nuisances) == ["load", "temperature", *names]
    for name in names:
        assert nuisances[name]["unit"] == "-"
        assert nuisances[name]["standard_error"] > 0
    assert len(diagnosed.coordinates) == len(diagnosed.covariance)


def test_without_nuisances_the_baseline_is_estimated(faulty: Recording, calibrated: Calibration) -> None:
    # Nuisances belong to the recording; the baseline belongs to the description.
    fit = faults_objective(problem_of(faulty, calibrated.actuator, channels=None), ())
    assert fit.space.nuisances.quantities == tuple(BASELINE + name for name in FREE)


# Refusals and files.


def test_a_second_calibration_replaces_the_first(healthy: list[Recording], calibrated: Calibration) -> None:
    again = calibrate(healthy[:1], calibrated.actuator, max_corrections=0, workers=1)
    baseline = again.actuator.baseline
    assert baseline is not None
    assert baseline.recordings == ("day 1",)
    assert baseline.names == FREE  # by default the same parameters
    assert again.actuator.name == calibrated.actuator.name == "thesis, calibrated"
    fresh = calibrate(healthy[:1], THESIS, FREE, max_corrections=0, workers=1)
    # The first covariance is no prior: the errors are those of a single recording.
    assert again.parameters["resistance"].standard_error == pytest.approx(
        fresh.parameters["resistance"].standard_error, rel=0.1
    )


def test_contradictory_choices_for_a_calibration_are_refused(
    healthy: list[Recording], calibrated: Calibration
) -> None:
    with pytest.raises(MethodError, match=r"^no recording to calibrate from; give one .* or several$"):
        calibrate([], THESIS, FREE)
    with pytest.raises(MethodError, match=r"has a baseline of 'viscous', .*; free 'viscous' too, or start"):
        calibrate(healthy, calibrated.actuator, ("inertia",))
    with pytest.raises(
        MethodError, match="nuisance 'load' cannot be separated from parameter 'offset'; leave one"
    ):
        calibrate(healthy, THESIS, ("inertia", "offset"), nuisances=("load",))
    with pytest.raises(MethodError, match=r"unknown nuisance 'laod' \(did you mean 'load'\?\)"):
        calibrate(healthy, THESIS, ("inertia",), nuisances=("laod",))


def test_a_calibrated_description_is_unchanged_by_a_file(calibrated: Calibration, tmp_path: Path) -> None:
    path = tmp_path / "unit-7.toml"
    calibrated.actuator.to_toml(path, comments=str(calibrated))
    assert Actuator.from_toml(path) == calibrated.actuator
