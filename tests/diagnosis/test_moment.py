"""A residual concentrated at one instant is detected; a lasting one or one of the only motion is not."""

import numpy as np

from cases import HEALTHY, THESIS, on_a_rig
from emaphm.actuator import Chirp, Faults, Step
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.moment import moment_of
from emaphm.estimation.posing import problem_of
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate


def joined(*parts: Recording) -> Recording:
    """Return one recording of several joined ones, with a continuous time."""
    channels = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    channels["time_s"] = np.arange(channels["time_s"].size) * parts[0].interval_s
    return Recording(channels, source="joined")


def deviation(recording: Recording) -> Array:
    """Return the squared residual of the current at a healthy actuator."""
    problem = problem_of(recording, THESIS)
    return np.asarray((problem.recorded - problem.predict_primary(HEALTHY)) ** 2).ravel()


def test_two_runs_in_one_recording_are_detected_at_their_junction() -> None:
    first, second = (simulate(THESIS, Chirp(stop_hz=hz), duration=0.25) for hz in (15.0, 14.0))
    joined_runs = joined(first, second)
    moment = moment_of(deviation(joined_runs), joined_runs["command_rad"])
    assert moment is not None
    assert 0 <= moment[0] - (first.samples - 1) < 10


def test_the_residual_of_a_fault_has_no_single_instant() -> None:
    recording = on_a_rig(THESIS, Faults(friction=0.4, short_b=0.3), 0.5)
    assert moment_of(deviation(recording), recording["command_rad"]) is None


def test_a_residual_at_the_only_motion_of_the_command_is_no_single_instant() -> None:
    step = simulate(THESIS, Step(2e-3, start=0.2), faults=Faults(gain=0.9), duration=0.5)
    assert moment_of(deviation(step), step["command_rad"]) is None
