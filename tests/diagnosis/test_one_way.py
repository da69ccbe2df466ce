"""Manoeuvres without reversal: no verdict on small faults, or on friction confounded with a load."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Command, Faults
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.one_way import moves_one_way, undecided_where_one_way
from emaphm.diagnosis.verdict import estimates
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

FAULTS = Faults(friction=0.4, short_a=0.08, short_b=0.4)


def step(times: Array) -> Array:
    return np.where(times >= 0.02, 3e-3, 0.0)


def there_and_back(times: Array) -> Array:
    return np.where((times >= 0.02) & (times < 0.1), 3e-3, 0.0)


def at_the_truth(command: Command, nuisances: tuple[str, ...] = ("load",)) -> SearchResult:
    whole = simulate(THESIS, command, model="averaged", faults=FAULTS, duration=0.2)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")})
    objective = faults_objective(problem_of(recording, THESIS), nuisances)
    return SearchResult.at(objective, objective.space.points(FAULTS.vector))


def verdicts(result: SearchResult) -> dict[str, str]:
    covariance = 1e-4 * np.eye(result.point.size)
    before = estimates(result.objective.space, result.point, covariance)
    assert {before[name].verdict for name in ("friction", "short_a", "short_b")} == {"degraded"}
    after = undecided_where_one_way(before, result)
    for name in ("friction", "short_a"):
        low, high = after[name].interval95
        assert (low <= 0 <= high) is (after[name].verdict == "cannot tell")
    return {name: after[name].verdict for name in ("friction", "short_a", "short_b")}


def test_after_a_step_only_large_faults_are_called_degraded() -> None:
    found_verdicts = verdicts(at_the_truth(step))
    assert found_verdicts == {"friction": "cannot tell", "short_a": "cannot tell", "short_b": "degraded"}


def test_a_large_friction_is_called_degraded_where_the_load_is_known() -> None:
    assert verdicts(at_the_truth(step, ()))["friction"] == "degraded"


@pytest.mark.parametrize(("command", "one_way"), [(step, True), (there_and_back, False)])
def test_a_manoeuvre_that_returns_is_not_one_way(command: Command, one_way: bool) -> None:
    result = at_the_truth(command)
    assert moves_one_way(result.objective, result.point) is one_way
    if not one_way:
        assert set(verdicts(result).values()) == {"degraded"}
