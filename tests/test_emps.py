"""A measured actuator: the EMPS benchmark, against what its authors identified by inverse dynamics.

Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System
Identification Benchmarks, 2019: mass 95.1089 kg, viscous friction 203.5034 N·s/m, Coulomb friction
20.3935 N, offset -3.1648 N, relative error of the simulated force 5.848 %.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import NAMES, Actuator
from emaphm.calibration import Calibration, calibrate
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.estimation import replay
from emaphm.recording import Recording, read_recording

FREE = ("inertia", "viscous", "coulomb", "offset")
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
def calibrated(measured: Recording, guess: Actuator) -> Calibration:
    return calibrate(measured, guess, FREE)


@pytest.fixture(scope="module")
def diagnosed(measured: Recording, calibrated: Calibration) -> Diagnosis:
    return diagnose(measured, calibrated.actuator)


def test_the_recording_is_what_its_authors_describe(measured: Recording) -> None:
    assert measured.samples == 24_841
    assert measured.sample_rate_hz == pytest.approx(1000)
    assert measured.sampling == "instant"
    # The control law that the data set states: vir = kv (kp (qg - qm) - speed), here by central differences.
    speed = np.gradient(measured["position_rad"], measured.interval_s)
    voltage = 243.45 * (160.18 * (measured["command_rad"] - measured["position_rad"]) - speed)
    apart = np.sqrt(np.mean((voltage - measured["current_A"]) ** 2) / np.mean(measured["current_A"] ** 2))
    assert apart < 0.1


@pytest.mark.parametrize(
    ("name", "published", "tolerance"),
    # The tolerances. Another method with another friction at low speed: viscous and Coulomb
    # friction trade against each other by a few per cent.
    [
        ("inertia", 95.1089, 0.01),
        ("viscous", 203.5034, 0.05),
        ("coulomb", 20.3935, 0.05),
        ("offset", -3.1648, 0.15),
    ],
)
def test_parameters_agree_with_the_published_ones(
    calibrated: Calibration, name: str, published: float, tolerance: float
) -> None:
    found = calibrated.parameters[name]
    assert found.value == pytest.approx(published, rel=tolerance)
    assert found.identifiable
    # And a standard error that admits the difference.
    assert abs(found.value - published) < 4 * found.standard_error


def test_units_are_those_of_a_linear_actuator(calibrated: Calibration) -> None:
    assert {name: p.unit for name, p in calibrated.parameters.items()} == {
        "inertia": "kg",
        "viscous": "N·s/m",
        "coulomb": "N",
        "offset": "N",
    }


def test_the_calibrated_model_replays_no_worse_than_the_published_one(
    calibrated: Calibration, measured: Recording, guess: Actuator
) -> None:
    assert calibrated.relative_error["current_A"] <= 0.0585
    assert calibrated.relative_error["position_rad"] <= 0.00013753
    assert replay(measured, guess).relative_error["current_A"] > 3 * calibrated.relative_error["current_A"]


def test_the_starting_values_do_not_matter(measured: Recording, guess: Actuator) -> None:
    mechanics = guess.mechanics.model_copy(
        update={
            "inertia_motor": 150.0,
            "viscous_motor": 400.0,
            "static_friction_motor": 35.0,
            "dynamic_friction_motor": 35.0,
        }
    )
    found = calibrate(measured, guess.model_copy(update={"mechanics": mechanics}), FREE)
    assert found.parameters["inertia"].value == pytest.approx(95.1089, rel=0.01)
    assert found.relative_error["current_A"] <= 0.0585


def test_the_rig_is_healthy(diagnosed: Diagnosis) -> None:
    assert diagnosed.explained
    for name in ("friction", "gain"):
        assert diagnosed.components[name].verdict == "healthy"
        assert diagnosed.components[name].identifiable


def test_what_the_description_lacks_is_named(diagnosed: Diagnosis) -> None:
    for name in set(NAMES) - {"friction", "gain"}:
        component = diagnosed.components[name]
        assert (component.verdict, component.identifiable) == ("cannot tell", False)
        missing = "healthy backlash is zero" if name == "backlash" else "electrical description"
        assert missing in component.reason
    # The temperature needs windings; the load, a drive of any kind can show.
    assert diagnosed.coordinates[:3] == ("friction", "gain", "load")
    # And none of its four parameters is known to a thousandth.
    assert set(diagnosed.nuisances) == {"load", *(f"baseline {name}" for name in FREE)}
    assert diagnosed.reference_runs == 0


def test_the_guess_is_not_taken_for_a_healthy_unit(measured: Recording, guess: Actuator) -> None:
    assert not diagnose(measured, guess).explained
