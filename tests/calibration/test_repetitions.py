"""Repetitions of a manoeuvre: they reduce the error by noise, and not that by unmodelled torque."""

import json

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.arrays import Array
from emaphm.calibration import Calibration, calibrate
from emaphm.errors import RecordingError
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

pytestmark = pytest.mark.usefixtures("no_model_error")

FREE = ("inertia", "viscous")
RIPPLED = Actuator.from_dict(THESIS.model_dump(exclude_none=True) | {"ripple": [{"order": 7, "cos": 0.02}]})
"""An actuator with a torque per position that the description lacks."""


def recorded(actuator: Actuator, seed: int, noise: float) -> Recording:
    whole = simulate(
        actuator,
        Chirp(stop_hz=15.0, duration=0.15),
        model="averaged",
        sampling="instant",
        sample_rate=1 / AVERAGED.step,
        duration=0.15,
    )
    kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")}
    levels = {"current_A": noise, "position_rad": 2e-4 * noise}
    return acquire(Recording(kept, "instant", f"day {seed}"), noise=levels, seed=seed)


def fitted(days: list[Recording]) -> Calibration:
    return calibrate(days, THESIS, FREE, nuisances=(), max_corrections=0, workers=1)


def errors(calibration: Calibration) -> Array:
    return np.array([calibration.parameters[name].standard_error for name in FREE])


def test_repetitions_do_not_reduce_the_error_of_unmodelled_torque() -> None:
    days = [recorded(RIPPLED, i, 0.02) for i in range(4)]
    joint, alone = fitted(days), fitted(days[:1])
    assert joint.error_correlation is not None
    assert joint.error_correlation > 0.8
    # A reduction by sqrt(4) would be 0.5.
    np.testing.assert_allclose(errors(joint) / errors(alone), 1.0, atol=0.15)
    assert "not averaged away in the standard errors" in str(joint)
    assert json.loads(joint.to_json())["error_correlation"] == joint.error_correlation
    assert alone.error_correlation is None


def test_a_copy_of_a_recording_is_refused() -> None:
    day = recorded(THESIS, 1, 0.1)
    copy = Recording(dict(day.channels), day.sampling, "copy")
    with pytest.raises(RecordingError, match="copy: the same, row by row, as day 1"):
        fitted([day, copy])


def test_repetitions_reduce_the_error_of_noise() -> None:
    days = [recorded(THESIS, i, 0.1) for i in range(4)]
    joint = fitted(days)
    alone = np.sqrt(np.mean([errors(fitted([day])) ** 2 for day in days], axis=0))
    assert joint.error_correlation is None
    np.testing.assert_allclose(errors(joint) / alone, 0.5, atol=0.1)
    assert "averaged away" not in str(joint)
