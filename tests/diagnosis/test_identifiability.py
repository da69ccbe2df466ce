"""How well an estimate is known: sensor errors act on their channel, collinear sets name what resolves."""

import numpy as np
import pytest

from cases import HEALTHY, THESIS, reference_recordings
from emaphm.arrays import Array
from emaphm.diagnosis.identifiability import further_information, identifiability
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult


def estimated(*nuisances: str) -> SearchResult:
    """Return the healthy actuator's estimate by its current alone, as it is without a search."""
    recording = reference_recordings([HEALTHY], noise=0.05)[0]
    objective = faults_objective(problem_of(recording, THESIS, channels=None), nuisances)
    return SearchResult.at(objective, objective.space.points(HEALTHY))


def along(result: SearchResult, information: Array, name: str) -> float:
    i = result.objective.space.coordinates.index(name)
    return float(information[i, i])


def test_an_error_of_the_current_sensor_does_not_show_in_another_channel() -> None:
    result = estimated("load", "current_offset", "current_scale")
    information = further_information(result, seed=0)
    assert {"voltage_V", "position_rad", "speed_rad_s", "load_Nm"} <= information.keys()
    for channel in ("voltage_V", "position_rad", "speed_rad_s"):
        assert along(result, information[channel], "friction") > 0
        for nuisance in ("current_offset", "current_scale"):
            assert along(result, information[channel], nuisance) == pytest.approx(0.0, abs=1e-9)


def test_heat_and_shorts_are_a_collinear_set_that_the_voltage_resolves() -> None:
    (found,) = identifiability(estimated("load", "temperature"), seed=0).collinear_sets
    assert set(found.members) == {"short_a", "short_b", "short_c", "temperature"}
    assert set(found.resolving) == {"voltage_V", "temperature_K"}


def test_a_search_that_has_not_converged_is_less_sure() -> None:
    result = estimated("load")
    away = result.objective.space.points(HEALTHY)
    away[0] = 0.05
    off = SearchResult.at(result.objective, away)
    error = np.sqrt(identifiability(off, seed=0).covariance[0, 0])
    # The step back to the optimum, 0.05 of friction, is part of its standard error.
    assert error > 0.03
    assert np.sqrt(identifiability(result, seed=0).covariance[0, 0]) < error / 3
