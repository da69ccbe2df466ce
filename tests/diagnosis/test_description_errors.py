"""Parameters that are not as described, and nobody said so: named, or taken into the intervals."""

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
    """Return the estimate of what is `described`, next to the true faults of a `unit`."""
    problem = problem_of(on_a_rig(unit, FAULTS, 0.5), described, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    return correct_bias(objective, objective.space.points(FAULTS.vector[np.newaxis]), 2, seed=0)


@pytest.mark.evidence
def test_a_speed_gain_that_is_off_is_no_sensor_and_no_friction() -> None:
    diagnosis = diagnose(on_a_rig(differing(THESIS, speed_gain=0.9), FAULTS, 0.3), THESIS)
    assert diagnosis.explained
    assert diagnosis.selected == ("baseline speed_gain",)
    assert diagnosis.sensor_faults == ()
    gain = diagnosis.nuisances["baseline speed_gain"]
    assert gain.value == pytest.approx(math.log(0.9), abs=max(0.01, 3 * gain.standard_error))
    assert diagnosis.components["friction"].value == pytest.approx(FAULTS.friction, abs=0.02)
    assert "speed_gain" in "\n".join(diagnosis.notes())


def test_shorts_are_known_no_better_than_a_motor_that_is_not_as_described() -> None:
    diagnosis = diagnose(on_a_rig(differing(THESIS, torque_constant=0.9), FAULTS, 0.3), THESIS)
    assert diagnosis.explained
    assert diagnosis.selected == tuple(f"baseline {name}" for name in MOTOR)
    assert all(covered(FAULTS.vector, diagnosis)[2:5])
    # The same motor errs in each recording: their mean is no better.
    shared = diagnosis.shared_covariance
    assert shared is not None
    assert shared[2, 2] == pytest.approx(diagnosis.covariance[2, 2], rel=0.5)


@pytest.mark.parametrize(
    "described", [THESIS, THESIS.model_copy(update={"tolerances": Tolerances(inductance=0.2)})]
)
def test_nothing_is_asked_for_of_a_motor_as_described(described: Actuator) -> None:
    assert possible_errors(near_the_truth(THESIS, described), (), seed=0) == []


def test_a_motor_is_asked_for_where_its_inductance_does_not_fit_the_shorts() -> None:
    result = near_the_truth(differing(THESIS, inductance=0.8))
    assert possible_errors(result, (), seed=0) == [PossibleError(MOTOR, certain=True)]
    # What a clock that is off changes too says nothing of the drive.
    both = possible_errors(result, ("inertia", "current_scale"), seed=0)
    assert [one.parameters for one in both] == [SPEED_LOOP, MOTOR]
    assert possible_errors(result, ("inertia", "current_scale", "speed_scale"), seed=0) == []


@pytest.mark.evidence
def test_recordings_of_one_unit_share_what_is_off() -> None:
    unit = differing(THESIS, torque_constant=0.9)
    recordings = [on_a_rig(unit, FAULTS, duration) for duration in (0.3, 0.5)]
    found = diagnose_joint(recordings, THESIS, workers=1)
    assert found.explained
    assert found.selected == tuple(f"baseline {name}" for name in MOTOR)
    assert all(covered(FAULTS.vector, found)[2:5])
    assert f"{', '.join(MOTOR)}, at least one of which deviates" in "\n".join(found.notes())
