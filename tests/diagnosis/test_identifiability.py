"""Identifiability of an estimate: information of further channels, and channels that resolve collinearity."""

import numpy as np
import pytest

from cases import HEALTHY, THESIS, reference_recordings
from emaphm.arrays import Array
from emaphm.diagnosis.identifiability import further_information, identifiability
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult


def estimated(*nuisances: str) -> SearchResult:
    """Return the estimate at the truth of a healthy actuator by its current alone, without a search."""
    recording = reference_recordings([HEALTHY], noise=0.05)[0]
    objective = faults_objective(problem_of(recording, THESIS, channels=None), nuisances)
    return SearchResult.at(objective, objective.space.points(HEALTHY))


def information_on(result: SearchResult, information: Array, name: str) -> float:
    i = result.objective.space.coordinates.index(name)
    return float(information[i, i])


def test_other_channels_have_no_information_on_an_error_of_the_current_sensor() -> None:
    result = estimated("load", "current_offset", "current_scale")
    information = further_information(result, seed=0)
    assert {"voltage_V", "position_rad", "speed_rad_s", "load_Nm"} <= information.keys()
    for channel in ("voltage_V", "position_rad", "speed_rad_s"):
        assert information_on(result, information[channel], "friction") > 0
        for nuisance in ("current_offset", "current_scale"):
            assert information_on(result, information[channel], nuisance) == pytest.approx(0.0, abs=1e-9)


def test_the_voltage_resolves_the_collinear_set_of_heat_and_shorts() -> None:
    (group,) = identifiability(estimated("load", "temperature"), seed=0).collinear_sets
    assert set(group.members) == {"short_a", "short_b", "short_c", "temperature"}
    assert set(group.resolving) == {"voltage_V", "temperature_K"}


def test_a_search_that_has_not_converged_has_a_larger_error() -> None:
    result = estimated("load")
    unconverged_point = result.objective.space.points(HEALTHY)
    unconverged_point[0] = 0.05
    unconverged = SearchResult.at(result.objective, unconverged_point)
    error = np.sqrt(identifiability(unconverged, seed=0).covariance[0, 0])
    # The step back to the optimum, 0.05 of friction, is part of its standard error.
    assert error > 0.03
    assert np.sqrt(identifiability(result, seed=0).covariance[0, 0]) < error / 3
