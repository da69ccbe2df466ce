"""Slow motions: their definition, and the error of an estimate by random switching."""

import numpy as np
import pytest

from cases import HEALTHY, THESIS
from emaphm.actuator import Chirp, Command, Sine
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import moves_slowly
from emaphm.estimation.uncertainty.switching_scores import switching_errors, switching_scores
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate


@pytest.mark.parametrize(
    ("command", "slow"),
    [(Sine(5e-3, 2.0), True), (Sine(2e-3, 5.0), True), (Sine(5e-3, 8.0), False), (Chirp(), False)],
)
def test_motions_are_slow_where_the_derivatives_of_the_models_differ(command: Command, *, slow: bool) -> None:
    # Ratio of the derivatives by a gain: 0.61 and 0.81 for the first two, 0.98 and 0.94 for the others.
    time = np.arange(1000) / 2000
    recording = Recording({"time_s": time, "command_rad": command(time), "current_A": np.sin(9 * time)})
    assert moves_slowly(problem_of(recording, THESIS)) is slow


def recorded(command: Command) -> Recording:
    """Return the current and an exact position of the healthy unit."""
    whole = simulate(THESIS, command, duration=0.6, sample_rate=2000.0)
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")})


def result_at_the_truth(recording: Recording) -> SearchResult:
    """Return the estimate at the truth of a healthy unit, without a search."""
    objective = faults_objective(problem_of(recording, THESIS, channels=None), ("load",))
    return SearchResult.at(objective, objective.space.points(HEALTHY))


def test_switching_errors_agree_with_the_scatter_between_recordings() -> None:
    """On a sine of 1 mrad the motor turns by half a radian, and its angle at rest differs between runs."""
    recordings = [recorded(Sine(1e-3 * (1 + 1e-5 * i), 2.0)) for i in range(10)]
    result = result_at_the_truth(recordings[0])
    errors = switching_errors(result, np.random.default_rng(0))
    assert errors is not None
    # The mean position over the last 50 ms: with independent rows it would scatter ten times less.
    mean = np.zeros((1, result.objective.channel_rows))
    mean[0, -100:] = 1 / (100 * result.objective.problem.weights[1])
    of_runs = float(np.atleast_2d(switching_scores(mean, errors))[0, 0])
    of_recordings = float(
        np.var([recording["position_rad"][-100:].mean() for recording in recordings], ddof=1)
    )
    assert 0.2 < of_runs / of_recordings < 5


def test_motions_that_are_not_slow_have_no_switching_errors() -> None:
    assert switching_errors(result_at_the_truth(recorded(Chirp())), np.random.default_rng(0)) is None
