"""A channel with a wrong scale must follow its quantity: a larger share of it is explained than of noise."""

import numpy as np
import pytest

from cases import HEALTHY, THESIS
from emaphm.actuator import Chirp
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.followed_channels import is_followed
from emaphm.diagnosis.explanation.reasons import reasons_against
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.sensor_faults import sensor_faults
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

ROWS, PARAMETERS = 1500, 12


def fitted_residual(signal: float, seed: int) -> tuple[Array, Array]:
    """Return white noise with `signal` times a sine, and its residual after a fit with twelve functions."""
    random = np.random.default_rng(seed)
    sine = np.sin(np.linspace(0, 20, ROWS))
    functions = np.column_stack([sine, random.normal(size=(ROWS, PARAMETERS - 1))])
    recorded = signal * sine + random.normal(size=ROWS)
    return recorded, recorded - functions @ np.linalg.lstsq(functions, recorded, rcond=None)[0]


@pytest.mark.parametrize(("signal", "followed"), [(0.0, False), (0.35, True), (1.0, True)])
def test_a_signal_below_the_noise_is_followed_and_noise_is_not(signal: float, followed: bool) -> None:
    results = {is_followed(*fitted_residual(signal, seed), PARAMETERS) for seed in range(200)}
    assert results == {followed}


@pytest.mark.parametrize("name", ["current", "voltage", "position"])
@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_permuted_rows_are_not_explained_by_a_scale_of_0(name: str, noise: float) -> None:
    whole = simulate(THESIS, Chirp(), model="averaged", noise=noise, duration=0.3, seed=7)
    channel = next(column for column in whole if column.startswith(f"{name}_") and column.count("_") == 1)
    channels = dict.fromkeys(("current_A", channel))
    columns = {column: whole[column] for column in ("time_s", "command_rad", *channels)}
    columns[channel] = np.random.default_rng(8).permutation(columns[channel])
    reasons = scaled_reasons(columns, name, -1.0, float(columns[channel].mean()))
    assert f"{channel} does not follow its quantity" in reasons


@pytest.mark.parametrize("factor", [0.3, -1.0])
def test_a_wrong_scale_is_accepted_in_noise(factor: float) -> None:
    whole = simulate(THESIS, Chirp(), model="averaged", noise=0.05, duration=0.3, seed=9)
    columns = {column: whole[column] for column in ("time_s", "command_rad", "current_A")}
    noise = np.random.default_rng(10).normal(0, 4 * abs(factor), whole.samples)
    columns["current_A"] = factor * columns["current_A"] + noise
    assert scaled_reasons(columns, "current", factor - 1, 0.0) == ""


def scaled_reasons(columns: dict[str, Array], name: str, scale: float, zero: float) -> str:
    """Return the reasons against healthy faults with a scale and a zero error of the sensor `name`."""
    named = (f"{name}_scale", f"{name}_offset")
    objective = faults_objective(problem_of(Recording(columns), THESIS, channels=None), named)
    point = objective.space.points(HEALTHY)
    units = objective.space.nuisance_values(np.ones((1, objective.space.dimensions)))
    for nuisance, value in zip(named, (scale, zero), strict=True):
        point[objective.space.coordinates.index(nuisance)] = value / units[nuisance][0]
    result = SearchResult.at(objective, point).reweighted()
    jacobians = jacobians_at(result.objective, result.point, np.random.default_rng(0))
    return "; ".join(reasons_against(result, jacobians, {}, 0, moves=True))


def test_a_scale_that_may_be_0_is_not_reported_as_a_size() -> None:
    estimate = {"current_scale": NuisanceEstimate(-0.98, 0.01, "-", True)}
    (fault,) = sensor_faults((), tuple(estimate), estimate, (), ("current_A",), THESIS, explained=True)
    assert "does not follow its quantity" in fault.sentence
    assert "times its quantity" not in fault.sentence
