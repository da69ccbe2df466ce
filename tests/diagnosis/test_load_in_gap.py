"""Caution on a recorded load that decides the side of the backlash."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.laws import law_named
from emaphm.diagnosis.explanation.load_in_gap import load_reverses_in_gap
from emaphm.estimation.posing import problem_of
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

FRICTION = THESIS.mechanics.static_friction_user


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate(THESIS, Chirp(duration=0.1), model="averaged", duration=0.1, sample_rate=1000.0)


@pytest.mark.parametrize(
    ("mean", "amplitude", "actuator", "noted"),
    [
        (0.0, 2.0, THESIS, True),
        (0.0, 0.9, THESIS, False),  # friction of the user is larger
        (4.0, 2.0, THESIS, False),  # one direction
        (0.0, 2.0, law_named("compliance").added_to(THESIS), False),
    ],
)
def test_a_load_that_reverses_has_a_caution_on_the_backlash_of_a_rigid_shaft(
    recording: Recording, mean: float, amplitude: float, actuator: Actuator, noted: bool
) -> None:
    load = FRICTION * (mean + amplitude * np.sin(60 * recording["time_s"]))
    channels = {name: recording[name] for name in recording} | {"load_Nm": load}
    loaded = Recording(channels, recording.sampling, recording.source)
    assert bool(load_reverses_in_gap(problem_of(loaded, actuator))) == noted


def test_an_unrecorded_load_has_no_caution(recording: Recording) -> None:
    assert not load_reverses_in_gap(problem_of(recording, THESIS))
