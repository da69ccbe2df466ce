"""The described PMSM: its three descriptions are equal, and its faults are estimated."""

from pathlib import Path

import pytest

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.diagnosis import diagnose, error_percent
from emaphm.estimation.compared_channels import compared_channels
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.study import cases
from emaphm.study.plan import Plan
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig

ROOT = Path(__file__).resolve().parents[1]
PLAN = Plan.load("pmsm")
RIGS = PLAN.rig_named
BRIEF = Manoeuvre(duration=0.2)


def test_preset_example_and_plan_describe_the_same_actuator() -> None:
    preset, example = Actuator.pmsm(), Actuator.from_toml(ROOT / "examples" / "pmsm" / "pmsm.toml")
    assert Actuator.load("pmsm") == PLAN.actuator == preset
    for section, values in preset.model_dump(exclude_none=True).items():
        example_section = example.model_dump(exclude_none=True)[section]
        if section in ("controller", "motor", "mechanics", "electrical", "drive"):
            assert {**values, "kind": 0, "end_stops": 0} == pytest.approx(
                {**example_section, "kind": 0, "end_stops": 0}
            )
        else:
            assert values == example_section


@pytest.mark.parametrize("faults", [Faults(eccentricity=0.25), cases.random_faults(7)], ids=str)
def test_faults_are_estimated_without_noise(faults: Faults) -> None:
    recording = recorded(RIGS["noise-free"], PLAN.actuator, BRIEF, faults, 0)
    diagnosis = diagnose(recording, PLAN.actuator, nuisances=(), seed=0, workers=1)
    # Required: 0.5 %; measured by the plan: 0.001 %. The drive does not switch by chance, as hysteresis does.
    assert error_percent(faults.vector, diagnosis.faults.vector) < 0.05
    assert diagnosis.explained


def test_currents_and_voltages_in_d_and_q_are_compared_once() -> None:
    recording = simulate(PLAN.actuator, Chirp(), duration=0.1)
    compared = compared_channels(recording, PLAN.actuator)
    assert compared == (
        "current_A", "voltage_V", "position_rad", "speed_rad_s", "current_d_A", "voltage_d_V",
    )  # fmt: skip
    of_drive = ("time_s", "command_rad", "current_d_A", "current_q_A", "voltage_d_V", "voltage_q_V")
    in_dq = Recording({name: recording[name] for name in of_drive})
    # The torque-producing current comes first.
    torque, *other_channels = compared_channels(in_dq, PLAN.actuator)
    assert (torque, *sorted(other_channels)) == ("current_q_A", "current_d_A", "voltage_d_V", "voltage_q_V")


def test_faults_are_estimated_on_a_rig() -> None:
    rig, faults = Rig(label="base setting"), cases.random_faults(3)
    diagnosis = diagnose(recorded(rig, PLAN.actuator, BRIEF, faults, 3), PLAN.actuator, seed=3, workers=1)
    assert error_percent(faults.vector, diagnosis.faults.vector) < 0.5
    assert diagnosis.explained
    assert any(
        "the assignment of phases rests on rotor_zero (0 rad)" in note for note in diagnosis.recording_notes
    )
