"""Drives without switching: deviations are selected, and the step of the model causes no bias."""

import numpy as np
import pytest

from cases import covered
from emaphm.actuator import NAMES, Actuator, Chirp, Command, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.arrays import Array
from emaphm.diagnosis import diagnose, error_percent
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

DC = Actuator.dc()
DURATION = 0.3
FAULTS = Faults(friction=0.3, backlash=0.4, gain=0.3)


def recorded(actuator: Actuator, faults: Faults, command: Command, seed: int = 0) -> Recording:
    whole = simulate(
        actuator, command, faults=faults, duration=DURATION, noise=0.05, adc_bits=16, load=0.1, seed=seed
    )
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")})


def square(t: Array) -> Array:
    return 5e-3 * np.sign(np.sin(2 * np.pi * 4.3 * t - 0.2))


@pytest.mark.parametrize("share", [-0.1, pytest.param(0.1, marks=pytest.mark.evidence)])
def test_a_deviating_inertia_is_selected(share: float) -> None:
    inertia = lumped_parameters(DC, ("inertia",))["inertia"]
    diagnosis = diagnose(
        recorded(
            with_lumped_parameters(DC, {"inertia": (1 + share) * inertia}), FAULTS, Chirp(duration=DURATION)
        ),
        DC,
    )
    assert diagnosis.selected == ("inertia",)
    assert diagnosis.nuisances["inertia"].value == pytest.approx(share, abs=0.01)
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) < 1


def test_the_step_of_the_averaged_model_causes_no_bias() -> None:
    recording = recorded(DC, FAULTS, Chirp(duration=DURATION))
    corrected, uncorrected = diagnose(recording, DC), diagnose(recording, DC, max_corrections=0)
    errors = [
        float(error_percent(FAULTS.vector, diagnosis.faults.vector)) for diagnosis in (corrected, uncorrected)
    ]
    assert errors[0] < 0.5 * errors[1]
    assert all(
        covered(FAULTS.vector, corrected)[NAMES.index(name)] for name in ("friction", "backlash", "gain")
    )


@pytest.mark.parametrize("faults", [Faults(), FAULTS], ids=["healthy", "faulty"])
def test_a_square_wave_is_explained(faults: Faults) -> None:
    diagnosis = diagnose(recorded(DC, faults, square), DC)
    assert diagnosis.explained
    assert diagnosis.sensor_faults == ()
    for name in ("friction", "backlash", "gain"):
        expected = "healthy" if faults == Faults() else "degraded"
        assert diagnosis.components[name].verdict == expected
