"""Slow motions: which they are, and what the chance of switching makes of an estimate there."""

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
def test_slow_is_what_makes_derivatives_differ(command: Command, *, slow: bool) -> None:
    # The ratio of the derivatives by a gain was 0.61 and 0.81 of the first two, 0.98 and 0.94 of the others.
    time = np.arange(1000) / 2000
    recording = Recording({"time_s": time, "command_rad": command(time), "current_A": np.sin(9 * time)})
    assert moves_slowly(problem_of(recording, THESIS)) is slow


def recorded(command: Command) -> Recording:
    """Return the current and an exact position of the healthy unit."""
    whole = simulate(THESIS, command, duration=0.6, sample_rate=2000.0)
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")})


def as_described(recording: Recording) -> SearchResult:
    """Return the healthy unit's estimate, as it is without a search."""
    objective = faults_objective(problem_of(recording, THESIS, channels=None), ("load",))
    return SearchResult.at(objective, objective.space.points(HEALTHY))


def test_switching_errors_are_as_large_as_recordings_differ() -> None:
    """On a sine of 1 mrad the motor turns by half a radian; where it rests is another angle in each run."""
    recordings = [recorded(Sine(1e-3 * (1 + 1e-5 * i), 2.0)) for i in range(10)]
    result = as_described(recordings[0])
    errors = switching_errors(result, np.random.default_rng(0))
    assert errors is not None
    # The position's mean over the last 50 ms: of independent rows it would differ ten times less.
    mean = np.zeros((1, result.objective.channel_rows))
    mean[0, -100:] = 1 / (100 * result.objective.problem.weights[1])
    of_runs = float(np.atleast_2d(switching_scores(mean, errors))[0, 0])
    of_recordings = float(
        np.var([recording["position_rad"][-100:].mean() for recording in recordings], ddof=1)
    )
    assert 0.2 < of_runs / of_recordings < 5


def test_motions_that_are_not_slow_have_none() -> None:
    assert switching_errors(as_described(recorded(Chirp())), np.random.default_rng(0)) is None
