"""Errors of friction at rest, by sensitivities of the reference model and not of the averaged model."""

import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration import Calibration, calibrate
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

pytestmark = pytest.mark.usefixtures("no_model_error")

WARNING = "times as large by the reference model"


def calibrated(described: Actuator) -> tuple[Calibration, float]:
    """Return the calibration of a unit with 10 % less static friction than described, and that friction."""
    static = 0.9 * described.mechanics.static_friction
    unit = with_lumped_parameters(described, {"static": static})
    recordings = []
    chirps = (Chirp(2e-3, stop_hz=8.0, duration=0.2), Chirp(1e-3, stop_hz=5.0, duration=0.3))
    for seed, chirp in enumerate(chirps):
        whole = simulate(unit, chirp, duration=chirp.duration, noise=0.05, seed=seed)
        names = ("time_s", "command_rad", "current_A", "voltage_V")
        recordings.append(Recording({name: whole[name] for name in names}, whole.sampling, f"{seed}.csv"))
    return calibrate(recordings, described, ["coulomb", "static"], nuisances=[]), static


def test_the_ripple_of_comparators_increases_the_error_of_static_friction() -> None:
    calibration, truth = calibrated(THESIS)
    static, coulomb = calibration.parameters["static"], calibration.parameters["coulomb"]
    assert any(WARNING in warning for warning in calibration.warnings)
    # With the sensitivities of the averaged model, the deviation was 18 standard errors.
    assert abs(static.value - truth) < 2 * static.standard_error
    assert coulomb.standard_error < 0.01 * coulomb.value
    assert abs(coulomb.value - THESIS.mechanics.dynamic_friction) < 3 * coulomb.standard_error


@pytest.mark.evidence  # The ripple of comparators, above, needs the same sensitivities.
def test_the_error_of_static_friction_covers_the_leaps_of_stick_slip() -> None:
    calibration, truth = calibrated(Actuator.six_step())
    static = calibration.parameters["static"]
    # With the sensitivities of the averaged model, the deviation was 3 %, 90 standard errors.
    assert static.standard_error < 0.05 * truth
    assert abs(static.value - truth) < 2 * static.standard_error
