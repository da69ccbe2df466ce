"""Detection with the model's output subtracted: a fault that the model lacks is detected."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Chirp, Faults
from emaphm.detection import Detector
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

COMMAND = Chirp(amplitude=5e-3, stop_hz=8.0, duration=0.25)


def recorded(seed: int, load: float = 0.05, rattle: float = 0.0) -> Recording:
    """Return a recording of a healthy unit, whose friction differs a little from run to run.

    `rattle` [A] is the size of a current at 300 Hz on the second half: a loose part, of which the model knows
    nothing.
    """
    rng = np.random.default_rng(seed)
    one = simulate(
        THESIS,
        COMMAND,
        faults=Faults(friction=0.004 * abs(rng.normal())),
        model="averaged",
        duration=0.25,
        sample_rate=2000.0,
        load=load,
        noise=0.05,
        seed=seed,
    )
    time = one["time_s"]
    extra = rattle * np.sin(2 * np.pi * 300 * time) * (time > 0.125)
    kept = ("time_s", "command_rad", "position_rad", "load_Nm")
    return Recording(
        {name: one[name] for name in kept} | {"current_A": one["current_A"] + extra}, source=f"run {seed}"
    )


@pytest.fixture(scope="module")
def detector() -> Detector:
    return Detector.learn([recorded(seed) for seed in range(12)], actuator=THESIS)


def test_a_fault_that_the_model_lacks_is_detected(detector: Detector) -> None:
    results = [detector.judge(recorded(seed, rattle=0.15)) for seed in range(100, 106)]
    assert not any(one.like_healthy for one in results)
    assert all(one.by_channel["current_A"] > 0.5 for one in results)


def test_healthy_runs_are_like_healthy(detector: Detector) -> None:
    results = [detector.judge(recorded(seed)) for seed in range(200, 212)]
    # At 1 %, two or more alarms of twelve have the probability 0.6 %.
    assert sum(not one.like_healthy for one in results) <= 1


def test_the_model_removes_the_effect_of_a_load_within_the_tolerance() -> None:
    loads = np.linspace(0.0495, 0.0505, 8)
    recordings = [recorded(seed, float(load)) for seed, load in enumerate(loads)]
    raw = Detector.learn(recordings)
    modelled = Detector.learn(recordings, actuator=THESIS)
    # The scale is the rms about the mean cycle: with the model, it is that of the noise.
    assert modelled.manoeuvres[0].scales[0] < raw.manoeuvres[0].scales[0]
