"""A calibration smooths a command whose noise the drive did not receive."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Chirp
from emaphm.calibration import calibrate
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate


def test_noise_of_the_recorder_is_no_inertia() -> None:
    recording = simulate(THESIS, Chirp(), model="averaged", duration=0.3)
    columns = {name: recording[name] for name in ("time_s", "command_rad", "current_A")}
    noise = np.random.default_rng(3).normal(0.0, 2e-5, recording.samples)
    noisy = Recording({**columns, "command_rad": columns["command_rad"] + noise})
    calibration = calibrate(noisy, THESIS, free=["inertia"], loop="closed", max_corrections=0)
    # Three standard errors; without smoothing the estimate is 13 % too low.
    assert calibration.parameters["inertia"].value == pytest.approx(THESIS.mechanics.inertia, rel=0.01)
    assert any("command_rad has noise" in note for note in calibration.notes())
