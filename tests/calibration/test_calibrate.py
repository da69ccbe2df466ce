"""Calibration against the true parameters of a synthetic unit: estimates, standard errors and reports."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Sampled
from emaphm.actuator.lumped_parameters import (
    lumped_parameters,
    not_calibrated,
    with_lumped_parameters,
)
from emaphm.calibration import Calibration, calibrate
from emaphm.calibration.findings import absolute_error
from emaphm.diagnosis import diagnose
from emaphm.errors import MethodError, RecordingError
from emaphm.estimation.space.parameter_variation import WIDEST_FACTOR
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

FREE = ("inertia", "viscous", "coulomb", "offset")
UNIT = with_lumped_parameters(
    THESIS, {"inertia": 3.2e-5, "viscous": 2e-4, "coulomb": 0.06, "offset": 0.02}, name="unit"
)
TRUE = lumped_parameters(UNIT, FREE)

WRONG_STARTS = [(0.7, 1.3, 0.7), (1.3, 0.7, 1.3), (1.3, 1.3, 1.3), (0.7, 0.7, 0.7)]


def misdescribed(factors: Sequence[float]) -> Actuator:
    """Return the unit with its first three parameters times `factors` and no offset."""
    values = {name: TRUE[name] * factor for name, factor in zip(FREE, factors, strict=False)}
    return with_lumped_parameters(UNIT, values | {"offset": 0.0}, name="guess")


def deviations(calibration: Calibration) -> dict[str, float]:
    """Return the deviation of each parameter from the truth, in standard errors."""
    return {name: (p.value - TRUE[name]) / p.standard_error for name, p in calibration.parameters.items()}


def own_recording(duration: float = 0.5, **options: Any) -> Recording:
    given: dict[str, Any] = {"noise": 0.1, "sample_rate": 1 / AVERAGED.step, "duration": duration} | options
    return simulate(UNIT, Chirp(duration=duration), model="averaged", sampling="instant", **given)


def current_of(recording: Recording) -> Recording:
    """Return the recording with only the command and the current."""
    kept = {name: recording[name] for name in ("time_s", "command_rad", "current_A")}
    return Recording(kept, recording.sampling)


@pytest.fixture(scope="module")
def instants() -> Recording:
    """Return a recording of the averaged model, one row per step, of which only the noise is unexplained."""
    return own_recording(duration=0.15)


@pytest.fixture(scope="module")
def calibration(instants: Recording) -> Calibration:
    """Return the calibration of all four parameters from the first wrong start."""
    return calibrate(instants, misdescribed(WRONG_STARTS[0]), FREE, max_corrections=0, seed=3)


@pytest.fixture(scope="module")
def reference() -> Recording:
    return simulate(UNIT, Chirp(duration=0.2), noise=0.05, duration=0.2)


@pytest.mark.parametrize(
    "factors",
    [*WRONG_STARTS[:2], *(pytest.param(start, marks=pytest.mark.evidence) for start in WRONG_STARTS[2:])],
)
def test_parameters_are_estimated_from_starts_that_are_wrong_by_30_percent(
    instants: Recording, factors: Sequence[float]
) -> None:
    calibration = calibrate(instants, misdescribed(factors), FREE, max_corrections=0)
    assert all(p.identifiable for p in calibration.parameters.values())
    # In one of 10,000 cases, one of four normal deviates exceeds 4.
    assert all(abs(deviation) < 4 for deviation in deviations(calibration).values())
    assert lumped_parameters(calibration.actuator, FREE) == pytest.approx(
        {name: p.value for name, p in calibration.parameters.items()}
    )


@pytest.mark.parametrize(
    "factors", [WRONG_STARTS[0], pytest.param(WRONG_STARTS[1], marks=pytest.mark.evidence)]
)
def test_parameters_are_estimated_from_a_recording_of_the_reference_model(
    reference: Recording, factors: Sequence[float]
) -> None:
    calibration = calibrate(reference, misdescribed(factors), FREE)
    # The averaged model differs from the reference model: its bias is 1 to 2 standard errors.
    assert all(abs(deviation) < 5 for deviation in deviations(calibration).values())
    assert calibration.parameters["inertia"].value == pytest.approx(TRUE["inertia"], rel=0.01)
    assert calibration.parameters["coulomb"].value == pytest.approx(TRUE["coulomb"], rel=0.02)
    # 0.2 mN·m·s/rad is some 5 % of the current at the speeds of the chirp.
    assert calibration.parameters["viscous"].value == pytest.approx(TRUE["viscous"], rel=0.1)
    assert calibration.parameters["offset"].value == pytest.approx(TRUE["offset"], rel=0.05)


def test_parameters_are_estimated_from_the_position_alone() -> None:
    # A weak position loop: if it followed its command within the noise, nothing would be identifiable.
    servo = with_lumped_parameters(UNIT, {"position_gain": 1e4})
    whole = simulate(servo, Chirp(), model="averaged", sampling="instant", sample_rate=1 / AVERAGED.step)
    kept = {name: whole[name] for name in ("time_s", "command_rad", "position_rad")}
    recording = acquire(Recording(kept, "instant"), noise={"position_rad": 1e-6}, seed=0)
    start = with_lumped_parameters(servo, {name: 1.3 * TRUE[name] for name in FREE[:3]})
    calibration = calibrate(recording, start, FREE[:3], nuisances=[], max_corrections=0)
    assert all(abs(deviations(calibration)[name]) < 4 for name in FREE[:3])
    assert calibration.parameters["inertia"].value == pytest.approx(TRUE["inertia"], rel=0.02)
    assert calibration.parameters["coulomb"].value == pytest.approx(TRUE["coulomb"], rel=0.02)
    (replayed,) = calibration.replays
    assert list(replayed.relative_error) == ["position_rad"]
    assert replayed.rms_error["position_rad"] == pytest.approx(1e-6, rel=0.05)


def test_notes_on_the_recordings_are_reported(instants: Recording) -> None:
    noted = Recording(instants.channels, instants.sampling, "monday", ["cut at 3 s"])
    calibration = calibrate(noted, misdescribed((1, 1, 1)), ["inertia"], max_corrections=0)
    assert json.loads(calibration.to_json())["notes"] == ["monday: cut at 3 s"]
    assert "monday: cut at 3 s." in str(calibration)


def test_standard_errors_agree_with_the_scatter_of_estimates() -> None:
    guess = misdescribed(WRONG_STARTS[0])
    calibrations = [
        calibrate(
            current_of(own_recording(duration=0.2, seed=i)), guess, FREE, nuisances=(), max_corrections=0
        )
        for i in range(16)
    ]
    for name in FREE:
        values = np.array([calibration.parameters[name].value for calibration in calibrations])
        claimed = np.sqrt(
            np.mean([calibration.parameters[name].standard_error ** 2 for calibration in calibrations])
        )
        # A standard deviation from 16 values has an error of 1 / sqrt(32) = 18 %.
        assert claimed / values.std(ddof=1) == pytest.approx(1, abs=0.35)
        assert abs(values.mean() - TRUE[name]) < 4 * claimed / np.sqrt(16)


def test_interval_means_of_the_averaged_model_give_accurate_parameters() -> None:
    recording = simulate(UNIT, Chirp(duration=0.25), model="averaged", duration=0.25)
    calibration = calibrate(recording, misdescribed(WRONG_STARTS[0]), FREE, max_corrections=0)
    assert calibration.parameters["viscous"].value == pytest.approx(TRUE["viscous"], rel=5e-3)


def test_parameters_kept_from_the_description_are_reported_as_not_measured(calibration: Calibration) -> None:
    kept = json.loads(calibration.to_json())["kept"]
    assert kept["backlash"] == {"value": UNIT.mechanics.backlash, "unit": "rad"}
    assert not set(kept) & set(FREE)
    (line,) = [note for note in calibration.notes() if "not measured by this calibration" in note]
    assert f"backlash {UNIT.mechanics.backlash:.4g} rad" in line
    assert "(in its described ratio to coulomb)" in line


def test_a_diagnosis_reports_parameters_that_the_calibration_has_not_measured(
    calibration: Calibration, instants: Recording
) -> None:
    calibrated = diagnose(instants, calibration.actuator, nuisances=(), max_corrections=0, workers=1)
    names = ["static", "backlash", "position_gain", "torque_constant", "resistance"]
    assert calibrated.to_dict()["not_calibrated"] == names
    assert any(
        line.startswith(f"The calibration has not measured {', '.join(names)}") for line in calibrated.notes()
    )
    # A description without calibration has no such note.
    plain = calibration.actuator.model_copy(update={"baseline": None})
    assert not_calibrated(plain) == ()


def test_shares_of_motor_and_user_are_kept(calibration: Calibration) -> None:
    mechanics, true = calibration.actuator.mechanics, UNIT.mechanics
    for name in ("inertia", "viscous", "dynamic_friction", "static_friction"):
        share = getattr(mechanics, f"{name}_motor") / getattr(mechanics, f"{name}_user")
        assert share == pytest.approx(getattr(true, f"{name}_motor") / getattr(true, f"{name}_user"))


def test_static_friction_follows_dynamic_friction(calibration: Calibration) -> None:
    mechanics = calibration.actuator.mechanics
    ratio = UNIT.mechanics.static_friction / UNIT.mechanics.dynamic_friction
    assert mechanics.static_friction == pytest.approx(ratio * mechanics.dynamic_friction)
    assert mechanics.dynamic_friction == pytest.approx(TRUE["coulomb"], rel=0.02)


def test_other_parameters_are_unchanged(instants: Recording) -> None:
    guess = misdescribed(WRONG_STARTS[0])
    calibration = calibrate(instants, guess, ["inertia", "coulomb"], max_corrections=0)
    expected = with_lumped_parameters(
        guess, {name: p.value for name, p in calibration.parameters.items()}, name="guess, calibrated"
    )
    assert calibration.actuator.model_copy(update={"baseline": None}) == expected
    assert calibration.actuator.electrical == guess.electrical
    assert calibration.actuator.controller == guess.controller


def test_a_gentle_manoeuvre_does_not_identify_the_resistance() -> None:
    # Below the limit of the supply, the current loop follows its reference for any resistance.
    gentle = current_of(simulate(THESIS, Chirp(amplitude=2e-3, stop_hz=4), noise=0.05))
    calibration = calibrate(gentle, THESIS, ["inertia", "coulomb", "resistance"], max_corrections=0)
    identifiable = {name: p.identifiable for name, p in calibration.parameters.items()}
    assert identifiable == {"inertia": True, "coulomb": True, "resistance": False}
    resistance = calibration.parameters["resistance"]
    # A parameter that the data do not identify keeps the width of its prior.
    assert resistance.factor == pytest.approx(WIDEST_FACTOR, rel=0.03)
    (line,) = [one for one in str(calibration).splitlines() if one.startswith("resistance")]
    assert "not identifiable from this recording: known within a factor of 30 only" in line
    assert f"{resistance.standard_error:.2g}" not in line


def test_the_absolute_error_of_an_unidentified_parameter_covers_the_true_value() -> None:
    # Friction of 0.3 A in the unit, and 0.02 A in the estimate: within the factor by its logarithm.
    assert absolute_error(0.02, 3.0) > 0.3 - 0.02
    # An accurate parameter has the error implied by its logarithm, in both directions.
    assert absolute_error(0.02, 0.1) == pytest.approx(0.002)


def test_a_common_factor_of_all_torques_is_not_identifiable_from_the_current() -> None:
    # Torque constant, inertia and friction times a common factor give the same current within rounding.
    recording = current_of(simulate(THESIS, Chirp(duration=0.15), duration=0.15))
    calibration = calibrate(recording, THESIS, ["torque_constant", "inertia", "coulomb", "viscous"])
    assert not any(p.identifiable for p in calibration.parameters.values())


@pytest.mark.parametrize(
    ("free", "seed"),
    [
        (["static"], 0),
        (["coulomb", "static"], 1),
        pytest.param(["static"], 1, marks=pytest.mark.evidence),
        pytest.param(["coulomb", "static"], 0, marks=pytest.mark.evidence),
    ],
)
def test_static_friction_may_be_as_small_as_dynamic_friction(free: list[str], seed: int) -> None:
    equal = with_lumped_parameters(THESIS, {"static": THESIS.mechanics.dynamic_friction})
    recording = simulate(equal, Chirp(duration=0.25), duration=0.25)
    guess = with_lumped_parameters(equal, {"static": 1.3 * equal.mechanics.static_friction})
    # Below dynamic friction the cost is constant, so that the end of a descent there depends on its start.
    calibration = calibrate(recording, guess, free, seed=seed).actuator.mechanics
    assert calibration.dynamic_friction == pytest.approx(equal.mechanics.dynamic_friction, rel=0.01)
    assert calibration.static_friction >= calibration.dynamic_friction


def test_a_recorded_load_is_no_offset() -> None:
    load = Sampled([0.0, 0.5], [0.05, 0.15])
    recording = own_recording(duration=0.25, load=load)
    calibration = calibrate(recording, misdescribed(WRONG_STARTS[1]), FREE, max_corrections=0)
    assert all(abs(deviation) < 4 for deviation in deviations(calibration).values())


def test_the_json_has_the_documented_content(calibration: Calibration) -> None:
    read = json.loads(calibration.to_json())
    units = {name: parameter["unit"] for name, parameter in read["parameters"].items()}
    assert units == {"inertia": "kg·m²", "viscous": "N·m·s/rad", "coulomb": "N·m", "offset": "N·m"}
    for name, parameter in read["parameters"].items():
        assert parameter["value"] == calibration.parameters[name].value
        assert parameter["standard_error"] > 0
    assert read["relative_error"] == calibration.relative_error == calibration.replays[0].relative_error
    assert set(read["relative_error"]) >= {"current_A", "position_rad", "speed_rad_s"}
    assert (read["seed"], read["actuator"]) == (3, "guess, calibrated")


def test_a_linear_actuator_is_calibrated_in_its_units() -> None:
    values = UNIT.model_dump() | {"coordinates": "linear"}
    linear = Actuator.from_dict(values)
    recording = simulate(linear, Chirp(duration=0.1), model="averaged", sampling="instant", duration=0.1)
    calibration = calibrate(recording, linear, FREE, max_corrections=0)
    assert [p.unit for p in calibration.parameters.values()] == ["kg", "N·s/m", "N", "N"]


def test_the_seed_determines_the_bits_for_any_number_of_workers() -> None:
    recording = simulate(UNIT, Chirp(duration=0.1), duration=0.1, noise=0.05)

    def bits(**options: Any) -> str:
        guess = misdescribed(WRONG_STARTS[2])
        calibration = calibrate(recording, guess, FREE, max_corrections=1, **options).to_dict()
        return json.dumps({name: value for name, value in calibration.items() if name != "seconds"})

    assert bits(workers=1) == bits(workers=2) == bits()


def test_a_name_given_twice_counts_once(instants: Recording) -> None:
    calibration = calibrate(instants, UNIT, ["inertia", "inertia"], max_corrections=0)
    assert list(calibration.parameters) == ["inertia"]


IDEAL = Actuator.from_dict(THESIS.model_dump() | {"electrical": None})


@pytest.mark.parametrize(
    ("actuator", "free", "message"),
    [
        (THESIS, [], r"no parameter to calibrate; name some of inertia, "),
        (THESIS, ["inertai"], r"unknown parameter 'inertai' \(did you mean 'inertia'\?\)"),
        (THESIS, ["inertia", "frction"], r"unknown parameter 'frction'"),
        (IDEAL, ["resistance"], r"'resistance' needs an \[electrical\] section, which .*'thesis' lacks"),
        (
            with_lumped_parameters(THESIS, {"viscous": 0.0}),
            ["inertia", "viscous"],
            r"'viscous' is 0 in actuator 'thesis', so its size is unknown; give an estimate",
        ),
        (THESIS, ["torque_lag"], r"'torque_lag' is 0"),
    ],
)
def test_parameters_that_cannot_be_calibrated_are_refused(
    instants: Recording, actuator: Actuator, free: list[str], message: str
) -> None:
    with pytest.raises(MethodError, match=message) as caught:
        calibrate(instants, actuator, free)
    assert "\n" not in str(caught.value)


def test_a_recording_in_foreign_units_is_refused(instants: Recording) -> None:
    degrees = {"command_rad": np.degrees(instants["command_rad"])}
    with pytest.raises(RecordingError, match="degrees"):
        calibrate(Recording(dict(instants.channels) | degrees), UNIT, FREE)
