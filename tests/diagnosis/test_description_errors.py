"""Parameters that deviate from the description without a tolerance: named, or included in the intervals."""

import math

import numpy as np
import pytest

from cases import THESIS, covered, differing, on_a_rig
from emaphm.actuator import Actuator, Faults
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.diagnosis import diagnose
from emaphm.diagnosis.joint import diagnose_joint
from emaphm.diagnosis.selection.description_errors import SPEED_LOOP, PossibleError, possible_errors
from emaphm.diagnosis.selection.settings import MOTOR
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult

FAULTS = Faults(0.5, 0.95, 0.1, 0.65, 0.2, 0.4, 0.8, 0.4)


def near_the_truth(unit: Actuator, described: Actuator = THESIS) -> SearchResult:
    """Return the estimate by the actuator `described` near the true faults of a `unit`."""
    problem = problem_of(on_a_rig(unit, FAULTS, 0.5), described, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    return correct_bias(objective, objective.space.points(FAULTS.vector[np.newaxis]), 2, seed=0)


@pytest.mark.evidence
def test_a_deviating_speed_gain_is_not_read_as_a_sensor_fault_or_friction() -> None:
    diagnosis = diagnose(on_a_rig(differing(THESIS, speed_gain=0.9), FAULTS, 0.3), THESIS)
    assert diagnosis.explained
    assert diagnosis.selected == ("baseline speed_gain",)
    assert diagnosis.sensor_faults == ()
    gain = diagnosis.nuisances["baseline speed_gain"]
    assert gain.value == pytest.approx(math.log(0.9), abs=max(0.01, 3 * gain.standard_error))
    assert diagnosis.components["friction"].value == pytest.approx(FAULTS.friction, abs=0.02)
    assert "speed_gain" in "\n".join(diagnosis.notes())


def test_intervals_of_shorts_include_a_motor_that_deviates() -> None:
    diagnosis = diagnose(on_a_rig(differing(THESIS, torque_constant=0.9), FAULTS, 0.3), THESIS)
    assert diagnosis.explained
    assert diagnosis.selected == tuple(f"baseline {name}" for name in MOTOR)
    assert all(covered(FAULTS.vector, diagnosis)[2:5])
    # The error of the motor is common to all recordings: their mean is no more accurate.
    shared = diagnosis.shared_covariance
    assert shared is not None
    assert shared[2, 2] == pytest.approx(diagnosis.covariance[2, 2], rel=0.5)


@pytest.mark.parametrize(
    "described", [THESIS, THESIS.model_copy(update={"tolerances": Tolerances(inductance=0.2)})]
)
def test_no_error_is_possible_for_a_motor_as_described(described: Actuator) -> None:
    assert possible_errors(near_the_truth(THESIS, described), (), seed=0) == []


def test_an_inductance_that_contradicts_the_shorts_is_a_possible_error() -> None:
    result = near_the_truth(differing(THESIS, inductance=0.8))
    assert possible_errors(result, (), seed=0) == [PossibleError(MOTOR, certain=True)]
    # A deviation that a wrong clock would also cause does not identify the drive.
    possible = possible_errors(result, ("inertia", "current_scale"), seed=0)
    assert [error.parameters for error in possible] == [SPEED_LOOP, MOTOR]
    assert possible_errors(result, ("inertia", "current_scale", "speed_scale"), seed=0) == []


@pytest.mark.evidence
def test_recordings_of_one_unit_share_deviating_parameters() -> None:
    unit = differing(THESIS, torque_constant=0.9)
    recordings = [on_a_rig(unit, FAULTS, duration) for duration in (0.3, 0.5)]
    diagnosis = diagnose_joint(recordings, THESIS, workers=1)
    assert diagnosis.explained
    assert diagnosis.selected == tuple(f"baseline {name}" for name in MOTOR)
    assert all(covered(FAULTS.vector, diagnosis)[2:5])
    assert f"{', '.join(MOTOR)}, at least one of which deviates" in "\n".join(diagnosis.notes())
