"""Warnings of a calibration by a recording with a wrong sign or unit, regardless of small standard errors."""

import json

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.calibration import Calibration, calibrate
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

LINEAR = Actuator.from_dict(
    THESIS.model_dump(exclude_none=True)
    | {
        "coordinates": "linear",
        "mechanics": THESIS.mechanics.model_dump(exclude_none=True) | {"end_stops": (-50.0, 50.0)},
    }
)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate(THESIS, Chirp(), model="averaged", noise=0.02, duration=0.3)


def scaled(recording: Recording, **factors: float) -> Recording:
    kept = {name: recording[name] for name in ("time_s", "command_rad", "position_rad", "current_A")}
    changed = {name: kept[name] * factor for name, factor in factors.items()}
    return Recording(kept | changed, recording.sampling, "monday")


def calibrated(recording: Recording, actuator: Actuator = THESIS, loop: str = "closed") -> Calibration:
    return calibrate(
        recording,
        actuator,
        ("inertia", "viscous"),
        loop=loop,  # type: ignore[arg-type]
        nuisances=(),
        max_corrections=0,
        workers=1,
    )


@pytest.mark.parametrize("loop", ["closed", "measured"])
def test_a_correct_recording_has_no_warning(recording: Recording, loop: str) -> None:
    result = calibrated(scaled(recording), loop=loop)
    assert result.warnings == ()
    assert "Warning" not in str(result)
    assert json.loads(result.to_json())["warnings"] == []


def test_a_current_of_the_wrong_sign_is_named(recording: Recording) -> None:
    result = calibrated(scaled(recording, current_A=-1.0))
    sign, unlike = result.warnings
    assert sign.startswith("monday: current_A is -")
    assert "of the opposite sign: negate current_A" in sign
    assert "monday: current_A is off by" in unlike
    assert f"Warning: {sign}." in str(result)
    assert json.loads(result.to_json())["warnings"] == [sign, unlike]


@pytest.mark.parametrize(
    ("actuator", "factor", "unit"), [(LINEAR, 1e3, "mm"), (THESIS, 180 / np.pi, "degrees")]
)
def test_a_position_in_another_unit_is_named(
    recording: Recording, actuator: Actuator, factor: float, unit: str
) -> None:
    foreign = scaled(recording, command_rad=factor, position_rad=factor)
    result = calibrated(foreign, actuator, "measured")
    assert any(f"as of a position in {unit}: convert" in warning for warning in result.warnings)
    # Least squares by measured motion are not limited to a range of values.
    inertia = result.parameters["inertia"]
    assert inertia.value == pytest.approx(2.5e-5 / factor, rel=0.1)
    assert "beyond the factor of 30" in inertia.reason


def test_the_refusal_of_a_calibration_names_the_sign(recording: Recording) -> None:
    with pytest.raises(ValueError, match="opposite sign"):
        calibrated(scaled(recording, current_A=-1.0), loop="measured")
