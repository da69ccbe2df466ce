"""The electrical zero of the rotor: an initial angle, with six equivalent motors per turn."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emaphm.actuator import Chirp, Faults
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.simulation import AVERAGED, REFERENCE, Initial, Inputs, Model, Plant, run
from simulation.rig import INTERVAL, THESIS

FAULTY = Faults(short_a=0.1, short_b=0.3, short_c=0.2)
ROTATED = Faults(short_a=0.3, short_b=0.2, short_c=0.1)


def driven(model: Model) -> Inputs:
    return Inputs.of(Chirp(), samples=500, interval=INTERVAL, step=model.step)


@pytest.mark.parametrize("model", [REFERENCE, AVERAGED], ids=["reference", "averaged"])
def test_the_rotor_zero_acts_as_the_initial_rotor_offset(model: Model) -> None:
    poles = THESIS.electrical.pole_pairs if THESIS.electrical else 1
    faults = Faults(short_b=0.3, eccentricity=0.4, eccentricity_phase=0.6).vector
    described = Plant.of(with_lumped_parameters(THESIS, {"rotor_zero": 0.7}), faults)
    by_description = run(model, described, driven(model))
    by_start = run(model, Plant.of(THESIS, faults), driven(model), Initial(rotor_offset=0.7 / poles))
    for name, rows in by_description.items():
        assert np.array_equal(rows, by_start[name]), name


@settings(max_examples=10)
@given(zero=st.floats(-1.0, 1.0))
def test_a_sixth_of_a_turn_renames_the_phases(zero: float) -> None:
    # Each phase takes the angle of another with opposite sign: current and back-EMF change their sign.
    before, after = (
        run(AVERAGED, Plant.of(THESIS, faults.vector, {"rotor_zero": angle}), driven(AVERAGED))
        for faults, angle in ((FAULTY, zero), (ROTATED, zero + np.pi / 3))
    )
    for name in ("current_A", "voltage_V", "position_rad", "speed_rad_s"):
        np.testing.assert_allclose(after[name], before[name], atol=1e-6 * np.abs(before[name]).max())
