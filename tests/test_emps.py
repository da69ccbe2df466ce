"""A measured actuator: the EMPS benchmark, compared with its authors' identification by inverse dynamics.

Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System
Identification Benchmarks, 2019: mass 95.1089 kg, viscous friction 203.5034 N·s/m, Coulomb friction
20.3935 N, offset -3.1648 N, relative error of the force 4.083 % by inverse dynamics, 5.848 % simulated; with
unequal friction 166.71 / 240.42 N·s/m and 20.144 / 20.628 N, 3.112 % by inverse dynamics.
"""

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from emaphm.actuator import NAMES, Actuator
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration import Calibration, calibrate
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.estimation import replay
from emaphm.estimation.inverse_dynamics import controller_check, inverse_dynamics
from emaphm.recording import Recording, read_recording

FREE = ("inertia", "viscous", "viscous_asymmetry", "coulomb", "offset", "transition_speed")
SYMMETRIC = ("inertia", "viscous", "coulomb", "offset")
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def guess() -> Actuator:
    return Actuator.from_toml(ROOT / "examples" / "emps" / "emps.toml")


@pytest.fixture(scope="module")
def measured(guess: Actuator) -> Recording:
    data = Path(os.environ.get("EMAPHM_DATA", ROOT.parent / "shared" / "data"))
    path = data / "emps" / "DATA_EMPS.mat"
    if not path.is_file():
        pytest.skip(f"the EMPS data are not at {path}; set EMAPHM_DATA to the folder that holds them")
    return read_recording(path, guess)


@pytest.fixture(scope="module")
def halves(measured: Recording) -> tuple[Recording, Recording]:
    middle = measured.samples // 2
    first, second = (
        Recording({name: measured[name][half] for name in measured}, "instant")
        for half in (slice(None, middle), slice(middle, None))
    )
    return first, second


@pytest.fixture(scope="module")
def calibrated(halves: tuple[Recording, Recording], guess: Actuator) -> Calibration:
    """Return the calibration by the second half; the first half is for prediction."""
    return calibrate(halves[1], guess, FREE, max_corrections=0)


@pytest.fixture(scope="module")
def quarter(measured: Recording) -> Recording:
    """Return the first quarter, which identifies the rig as well as other quarters."""
    return Recording({name: measured[name][: measured.samples // 4] for name in measured}, "instant")


@pytest.fixture(scope="module")
def diagnosed(quarter: Recording, calibrated: Calibration) -> Diagnosis:
    return diagnose(quarter, calibrated.actuator, max_corrections=1)


def test_the_recording_agrees_with_the_description_by_its_authors(measured: Recording) -> None:
    assert measured.samples == 24_841
    assert measured.sample_rate_hz == pytest.approx(1000)
    assert measured.sampling == "instant"
    # The control law that the data set states: vir = kv (kp (qg - qm) - speed), the speed being the
    # difference over the two periods before.
    position = measured["position_rad"]
    speed = (position[2:] - position[:-2]) / (2 * measured.interval_s)
    voltage = 243.45 * (160.18 * (measured["command_rad"] - position)[2:] - speed)
    current = measured["current_A"][2:]
    assert np.linalg.norm(voltage - current) / np.linalg.norm(current) < 0.003


@pytest.mark.parametrize(
    ("name", "published", "tolerance"),
    # Another method with another friction at low speed: viscous and Coulomb friction are confounded by a few
    # per cent. A constant load represents unequal Coulomb friction: half its difference.
    [
        ("inertia", 95.1089, 0.01),
        ("viscous", (166.71 + 240.42) / 2, 0.05),
        ("viscous_asymmetry", (166.71 - 240.42) / (166.71 + 240.42), 0.05),
        ("coulomb", (20.144 + 20.628) / 2, 0.05),
        ("offset", (20.144 - 20.628) / 2, 0.5),
    ],
)
def test_parameters_agree_with_the_published_parameters(
    calibrated: Calibration, name: str, published: float, tolerance: float
) -> None:
    parameter = calibrated.parameters[name]
    assert parameter.value == pytest.approx(published, rel=tolerance)
    assert parameter.identifiable
    # The standard error must be consistent with the difference.
    assert abs(parameter.value - published) < 4 * parameter.standard_error


def test_units_are_those_of_a_linear_actuator(calibrated: Calibration) -> None:
    assert {name: p.unit for name, p in calibrated.parameters.items()} == {
        "inertia": "kg",
        "viscous": "N·s/m",
        "viscous_asymmetry": "-",
        "coulomb": "N",
        "offset": "N",
        "transition_speed": "m/s",
    }


def test_the_error_of_the_calibrated_model_is_no_larger_than_published(
    calibrated: Calibration, measured: Recording, guess: Actuator
) -> None:
    replayed = replay(measured, calibrated.actuator).relative_error
    assert replayed["current_A"] <= 0.035
    assert replayed["position_rad"] <= 0.00001
    assert replay(measured, guess).relative_error["current_A"] > 3 * replayed["current_A"]


@pytest.mark.parametrize(
    ("free", "published", "force_error"),
    [
        (SYMMETRIC, (95.1089, 203.5034, 20.3935, -3.1648), 0.04083),
        (
            ("inertia", "viscous", "viscous_asymmetry", "coulomb", "coulomb_asymmetry"),
            (95.1089, 203.565, -0.18105, 20.386, -0.01187),
            0.03112,
        ),
    ],
)
def test_inverse_dynamics_estimates_the_published_values(
    measured: Recording,
    guess: Actuator,
    free: tuple[str, ...],
    published: tuple[float, ...],
    force_error: float,
) -> None:
    # As by the authors: without the drive's hold, and with low-passes of about their frequencies.
    bare = guess.model_copy(update={"friction": None})
    bare = with_lumped_parameters(bare, {"torque_lag": 0.0})
    estimate = inverse_dynamics(measured, bare, free, position_hz=100.0, regression_hz=50.0)
    assert tuple(estimate.values.values()) == pytest.approx(published, rel=0.01, abs=0.001)
    assert estimate.relative_error == pytest.approx(force_error, abs=0.0005)


def test_inverse_dynamics_and_the_closed_loop_agree(
    halves: tuple[Recording, Recording], guess: Actuator, calibrated: Calibration
) -> None:
    estimate = inverse_dynamics(halves[1], guess, FREE)
    assert estimate.relative_error < 0.026
    for name in set(FREE) - {"transition_speed"}:
        closed = calibrated.parameters[name]
        error = np.hypot(estimate.standard_errors[name], closed.standard_error)
        assert abs(estimate.values[name] - closed.value) < 3 * error
    # The result is a start for the fit by simulation, and is almost its end.
    start = replay(halves[1], estimate.identified).relative_error["current_A"]
    assert start < calibrated.relative_error["current_A"] + 0.002


def test_the_described_controller_is_that_of_the_recording(quarter: Recording, guess: Actuator) -> None:
    check = controller_check(quarter, guess)
    assert check.relative_error < 0.01
    assert not check.contradicts
    assert check.position_gain is not None
    assert check.position_gain.value == pytest.approx(160.18, rel=0.001)
    for gains in ({"position_gain": 200.0}, {"speed_gain": 7000.0}):
        assert controller_check(quarter, with_lumped_parameters(guess, gains)).contradicts


@pytest.mark.evidence
def test_half_of_the_recording_predicts_the_other_half_from_any_start(
    halves: tuple[Recording, Recording], guess: Actuator
) -> None:
    mechanics = guess.mechanics.model_copy(
        update={
            "inertia_motor": 150.0,
            "viscous_motor": 400.0,
            "static_friction_motor": 35.0,
            "dynamic_friction_motor": 35.0,
        }
    )
    calibration = calibrate(halves[1], guess.model_copy(update={"mechanics": mechanics}), FREE)
    assert calibration.parameters["inertia"].value == pytest.approx(95.1089, rel=0.01)
    assert calibration.relative_error["current_A"] <= 0.035
    assert replay(halves[0], calibration.actuator).relative_error["current_A"] <= 0.036


def test_the_rig_is_healthy(diagnosed: Diagnosis) -> None:
    assert diagnosed.explained
    for name in ("friction", "gain"):
        assert diagnosed.components[name].verdict == "healthy"
        assert diagnosed.components[name].identifiable


def test_missing_sections_of_the_description_are_named(diagnosed: Diagnosis) -> None:
    for name in set(NAMES) - {"friction", "gain"}:
        component = diagnosed.components[name]
        assert (component.verdict, component.identifiable) == ("cannot tell", False)
        missing = "healthy backlash is zero" if name == "backlash" else "electrical description"
        assert missing in component.reason
    # The temperature needs windings; the load can be identified with any drive.
    assert diagnosed.coordinates[:3] == ("friction", "gain", "load")
    # None of its six parameters is known to a thousandth.
    assert set(diagnosed.nuisances) == {"load", *(f"baseline {name}" for name in FREE)}


@pytest.mark.evidence
def test_an_uncalibrated_description_is_not_taken_for_a_healthy_unit(
    quarter: Recording, guess: Actuator
) -> None:
    assert not diagnose(quarter, guess).explained


def axis_with_pulses(sign: float) -> dict[str, np.ndarray]:
    """Return 2 s of an axis with the published values, under pulses of 40 N against (1) or with the motor."""
    time = 1e-3 * np.arange(2000)
    command = 0.05 * (1 - np.cos(2 * np.pi * time / 2))
    pulses = np.where((time % 1.0 > 0.4) & (time % 1.0 < 0.6), 40.0, 0.0)
    position, voltage = np.zeros((2, time.size))
    x = speed = 0.0
    for k in range(time.size):
        position[k] = x
        measured = (x - position[k - 2]) / 2e-3 if k > 1 else 0.0
        voltage[k] = np.clip(243.45 * (160.18 * (command[k] - x) - measured), -10, 10)
        for _ in range(10):
            friction = 203.5 * speed + 20.4 * np.tanh(speed / 1e-3)
            speed += 1e-4 * (35.15065188 * voltage[k] - sign * pulses[k] - friction) / 95.1
            x += 1e-4 * speed
    return {"t": time, "qg": command, "qm": position, "vir": voltage, "pulses_N": pulses}


@pytest.mark.parametrize("sign", [-1.0, 0.0])
def test_the_sign_of_the_force_pulses_is_identified_from_the_motion(
    guess: Actuator, tmp_path: Path, capsys: pytest.CaptureFixture[str], sign: float
) -> None:
    spec = importlib.util.spec_from_file_location("emps", ROOT / "examples" / "emps" / "emps.py")
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    columns = axis_with_pulses(sign)
    path = tmp_path / "another name.mat"
    savemat(path, {name: values[:, np.newaxis] for name, values in columns.items()})
    recording = example.read(path, guess)
    note = "taken as a force with the motor" if sign else "left out"
    assert f"pulses_N {note}" in capsys.readouterr().out
    if sign:
        np.testing.assert_allclose(recording["load_Nm"], sign * columns["pulses_N"])
    assert ("load_Nm" in recording) == bool(sign)
    parameters = inverse_dynamics(recording, guess, SYMMETRIC).parameters
    assert parameters["inertia"].value == pytest.approx(95.1, rel=0.01)
    assert parameters["coulomb"].value == pytest.approx(20.4, rel=0.03)
