"""The residual of a search, relative to noise and switching."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Chirp
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.simulated_recording import simulate


@pytest.mark.parametrize("left_out", [0.0, 0.5])
def test_white_noise_has_a_ratio_of_1_for_any_share_of_omitted_rows(left_out: float) -> None:
    problem = problem_of(simulate(THESIS, Chirp(), model="averaged", duration=0.1), THESIS)
    space = ParameterSpace.of(THESIS)
    result = SearchResult.at(MapObjective.of(problem, space), np.zeros(space.dimensions))
    noise = np.random.default_rng(17).normal(size=4000)
    noise[: round(left_out * noise.size)] = 0.0
    assert result.ratios_to_switching({"current_A": noise})["current_A"] == pytest.approx(1.0, abs=0.04)
