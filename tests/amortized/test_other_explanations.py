"""Other explanations of the faults of an answer alone: none, or a law that the description lacks."""

import numpy as np
import pytest

from cases import THESIS, on_a_rig
from emaphm.actuator import Actuator, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.amortized.error_prediction import other_explanations as module
from emaphm.amortized.error_prediction.other_explanations import other_explanations
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.recording import Recording

FAULTS = Faults(friction=0.3, backlash=0.2, short_b=0.25, gain=0.4)


def explanations(
    actuator: Actuator, faults: Faults, off: float = 0.0, hum: float = 0.0
) -> tuple[tuple[str, ...], int]:
    """Return other explanations of an estimate for a recording of `actuator`, and the reference runs.

    The error of the estimate is `off` in the friction, and the current has a `hum` of 50 Hz [A].
    """
    whole = on_a_rig(actuator, faults, 0.3)
    current = whole["current_A"] + hum * np.sin(2 * np.pi * 50.0 * whole["time_s"])
    recording = Recording({name: whole[name] for name in whole} | {"current_A": current})
    problem = problem_of(recording, THESIS, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    point = correct_bias(objective, objective.space.points(faults.vector[np.newaxis]), 2, seed=0).point
    point[objective.space.coordinates.index("friction")] += off
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


def test_an_answer_that_the_reference_model_moves_is_not_accepted() -> None:
    # 0.02 are six standard deviations of the answer; the averaged model explains the recording there.
    (clause,), _ = explanations(THESIS, FAULTS, off=0.02)
    assert "the reference model moves it by" in clause
    assert "in friction" in clause


def test_an_answer_with_a_large_residual_after_the_step_is_not_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Neither a law nor a parameter explains mains hum; one that resembles it would be named before.
    for name in ("suspected_laws", "possible_errors", "contradicted_control"):
        monkeypatch.setattr(module, name, lambda *_: [])
    (clause,), _ = explanations(THESIS, FAULTS, hum=0.3)
    assert "the residual of current_A is " in clause
    assert "times that of noise and switching" in clause


def test_no_explanation_is_tested_if_no_fault_is_degraded() -> None:
    assert explanations(THESIS, Faults()) == ((), 0)
