"""Late sensors in slow motion: a response of the reference model is not read as a delay."""

from dataclasses import replace

import numpy as np
import pytest

from cases import HEALTHY, THESIS
from emaphm.actuator import Sine
from emaphm.arrays import Array
from emaphm.diagnosis.explanation import sensor_scores
from emaphm.estimation.objective import MapObjective, faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.recording import Recording

LATE = 1e-4
SUSPECTED = sensor_scores.SensorScore("delay", "current_A", LATE, LATE / 10)


def slow_sine() -> MapObjective:
    time = np.arange(1000) / 2000
    columns = {"time_s": time, "command_rad": Sine(5e-3, 2.0)(time), "current_A": np.sin(9 * time)}
    return faults_objective(problem_of(Recording(columns), THESIS), ("load",))


def test_the_response_of_the_reference_model_to_a_gain_is_not_read_as_a_delay(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    objective = slow_sine()
    point, rows = objective.space.points(HEALTHY), objective.channel_rows
    jacobians = jacobians_at(objective, point, np.random.default_rng(0))
    gain, modelled = objective.space.coordinates.index("gain"), objective.outputs(point[np.newaxis])[0]
    later = -np.gradient(modelled[:rows], objective.problem.inputs.interval)
    # In part, the response to a gain equals that to a delay, which the fitted model does not have.
    response = jacobians.mean(axis=0)
    response[gain] += 20 * LATE * later
    monkeypatch.setattr(sensor_scores, "reference_response", lambda *_: response)
    monkeypatch.setattr(sensor_scores, "switching_errors", lambda *_: None)

    def score_for(added: Array) -> sensor_scores.SensorScore:
        noise, problem = np.random.default_rng(1).normal(0.0, 1e-5, rows), objective.problem
        current = (modelled[:rows] + added + noise) / problem.weights[0]
        recorded = replace(problem, measured={**problem.measured, "current_A": current})
        result = SearchResult.at(replace(objective, problem=recorded), point, outputs=modelled)
        (score,) = sensor_scores.answered_by_reference(result, jacobians, [SUSPECTED], seed=0)
        return score

    of_a_gain = score_for(0.05 * response[gain])
    # If it were read as a delay, its size would be LATE; by the priors, a part of it remains.
    assert abs(of_a_gain.size) < LATE / 4
    assert not of_a_gain.is_suspect()
    late = score_for(LATE * later)
    assert late.size == pytest.approx(LATE, rel=0.05)
    assert late.standard_error >= SUSPECTED.standard_error
    assert late.is_suspect()
