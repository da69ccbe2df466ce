"""What else may be the faults that an answer alone names: nothing, or a law that nobody described."""

import numpy as np

from cases import THESIS, on_a_rig
from emaphm.actuator import Actuator, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.amortized.error_prediction.other_explanations import other_explanations
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult

FAULTS = Faults(friction=0.3, backlash=0.2, short_b=0.25, gain=0.4)


def explanations(actuator: Actuator, faults: Faults) -> tuple[tuple[str, ...], int]:
    """Return what else may be the estimate for a recording of `actuator`, and runs of the reference model."""
    problem = Problem.of(on_a_rig(actuator, faults, 0.3), THESIS, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    point = correct_bias(objective, objective.space.points(faults.vector[np.newaxis]), 2, seed=0).point
    before = problem.runs.of(problem.model)[1]
    found = other_explanations(SearchResult.at(objective, point), 1e-5 * np.eye(point.size), seed=0)
    return found, problem.runs.of(problem.model)[1] - before


def test_a_law_that_nobody_described_may_be_the_faults() -> None:
    actuator = with_lumped_parameters(LAWS["saturation"].added_to(THESIS), {"saturation": 0.01})
    (clause,), _ = explanations(actuator, FAULTS)
    assert "'saturation'" in clause
    assert "lacks" in clause


def test_faults_of_the_actuator_as_described_are_nothing_else() -> None:
    found, compared = explanations(THESIS, FAULTS)
    assert found == ()
    assert compared > 0


def test_nothing_is_asked_where_no_fault_is_named() -> None:
    assert explanations(THESIS, Faults()) == ((), 0)
