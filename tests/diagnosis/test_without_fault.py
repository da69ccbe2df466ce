"""Faults that are not required: a refit with the component healthy explains the recording equally well."""

from cases import THESIS, USUAL
from emaphm import Faults, diagnose
from emaphm.actuator import Ramp
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.study.record import actuator_on
from emaphm.study.rig import Rig


def test_a_load_in_a_motion_without_reversal_is_not_called_friction() -> None:
    """On a ramp, friction and an unrecorded load differ only at the breakaway."""
    whole = simulate(
        actuator_on(Rig(label="ramp"), THESIS, 43),
        Ramp(1 / 30),
        faults=Faults(),
        duration=0.3,
        sample_rate=2000.0,
        noise=0.05,
        adc_bits=12,
        seed=43,
    )
    columns = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")}
    diagnosis = diagnose(Recording(columns), THESIS, nuisances=USUAL, seed=43, workers=1)
    assert diagnosis.components["friction"].verdict == "cannot tell"
