"""A torque constant that falls with the current is no fault, where small faults would make up for it too."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.diagnosis import diagnose
from emaphm.diagnosis.selection.saturation import is_saturation_suspected, saturation_score
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

LAW = LAWS["saturation"]
LIMIT = THESIS.controller.current_limit
FAULTS = Faults(0.3, 0.4, 0.0, 0.25, 0.1, 0.35, 0.7, 0.4)


def saturating(value: float) -> Actuator:
    return with_lumped_parameters(LAW.added_to(THESIS), {"saturation": value}) if value else THESIS


def recorded(value: float, faults: Faults, duration: float) -> Recording:
    """Return a recording of a motor with a saturation of `value` [1/A]."""
    whole = simulate(
        saturating(value), Chirp(duration=duration), faults=faults, duration=duration, noise=0.05, adc_bits=12
    )
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})


def near_the_truth(value: float, actuator: Actuator = THESIS) -> SearchResult:
    """Return the estimate of `actuator` next to the true faults, of a recording with a saturation."""
    objective = faults_objective(Problem.of(recorded(value, FAULTS, 0.2), actuator), ("load",))
    return correct_bias(objective, objective.space.points(FAULTS.vector[np.newaxis]), 2, seed=0)


@pytest.mark.parametrize("value", [0.01, -0.01])
def test_a_saturation_is_suspected_where_there_is_one(value: float) -> None:
    result = near_the_truth(value)
    assert is_saturation_suspected(result, seed=0)
    # A linear step, the other parameters making up for a part.
    assert saturation_score(result, seed=0)[1] == pytest.approx(abs(value) * LIMIT, rel=0.4)


def test_none_is_suspected_without_one_or_where_it_is_described() -> None:
    assert not is_saturation_suspected(near_the_truth(0.0), seed=0)
    assert not is_saturation_suspected(near_the_truth(0.01, saturating(0.01)), seed=0)


def test_a_saturation_that_nobody_described_is_no_fault() -> None:
    found = diagnose(recorded(0.01, Faults(), 0.5), THESIS)
    assert found.explained
    assert found.laws == ("saturation",)
    assert {one.verdict for name, one in found.components.items() if name != "eccentricity_phase"} == {
        "healthy"
    }
    value = found.nuisances["baseline saturation"]
    assert value.value == pytest.approx(0.01, abs=4 * value.standard_error)
    assert value.standard_error < 0.001
