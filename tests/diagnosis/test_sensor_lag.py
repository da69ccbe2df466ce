"""A lag of the drive's current sensors: identified from the ripple, independently of the total residual."""

from dataclasses import replace

import numpy as np
import pytest

from cases import THESIS, on_a_rig
from emaphm.actuator import Actuator, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.actuator.unit.model_error import ChannelError, ModelError
from emaphm.diagnosis.selection.extension import with_nuisances
from emaphm.diagnosis.selection.laws.law_fit import with_free_law, with_law
from emaphm.diagnosis.selection.laws.sensor_lag import is_lag_suspected, with_sensor_lag
from emaphm.estimation.bias_correction import correct_bias, with_discrepancy
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings

LAG = LAWS["sensor-lag"]
FAULTS = Faults(0.3, 0.4, 0.0, 0.25, 0.1, 0.35, 0.7, 0.4)


def at_the_truth(lag: float, actuator: Actuator = THESIS, noise: float = 0.05) -> SearchResult:
    """Return the true faults as an estimate of `actuator`, of a recording with a `lag` [s] of the current."""
    present = with_lumped_parameters(LAG.added_to(THESIS), {"current_lag": lag}) if lag else THESIS
    recording = on_a_rig(present, FAULTS, 0.2, noise)
    objective = faults_objective(problem_of(recording, actuator), ("load",))
    point = objective.space.points(FAULTS.vector[np.newaxis])[0]
    return with_discrepancy(SearchResult.at(objective, point), seed=0)


@pytest.mark.parametrize("lag", [5e-6, 2e-5])
def test_an_undescribed_lag_is_suspected(lag: float) -> None:
    assert is_lag_suspected(at_the_truth(lag), seed=0)


def test_no_lag_is_suspected_without_a_lag_or_with_a_described_one() -> None:
    assert not is_lag_suspected(at_the_truth(0.0), seed=0)
    assert not is_lag_suspected(at_the_truth(2e-5, LAG.added_to(THESIS)), seed=0)


def test_no_lag_is_suspected_where_noise_hides_the_ripple() -> None:
    assert not is_lag_suspected(at_the_truth(0.0, noise=1.0), seed=0)


def test_an_added_law_keeps_the_scale_of_a_nuisance_with_a_wider_prior() -> None:
    objective, _ = with_nuisances(at_the_truth(0.0), (), ("current_scale",))
    point = np.full(objective.space.dimensions, 0.01)
    before = objective.space.nuisance_values(point[np.newaxis])
    for extended in (with_law(objective, LAG), with_free_law(objective, LAG, LAG.parameters)):
        longer = np.zeros(extended.space.dimensions)
        longer[: point.size] = point
        after = extended.space.nuisance_values(longer[np.newaxis])
        assert {name: after[name] for name in before} == before


def test_no_lag_is_suspected_where_the_drive_senses_no_current() -> None:
    result = at_the_truth(0.0)
    problem = replace(result.objective.problem, actuator=Actuator.pmsm())
    assert not is_lag_suspected(replace(result, objective=replace(result.objective, problem=problem)), seed=0)


def test_a_lag_is_suspected_where_the_estimate_has_compensated_a_part() -> None:
    truth = at_the_truth(4e-5)
    compensated = correct_bias(truth.objective, truth.point[np.newaxis], 3, seed=0)
    assert compensated.residual_is_expected
    assert is_lag_suspected(compensated, seed=0)


@pytest.mark.parametrize("lag", [0.0, 2e-6])
def test_a_lag_is_selected_only_if_it_clearly_reduces_the_residual(lag: float) -> None:
    truth = at_the_truth(lag)
    with_lag = with_sensor_lag(truth, truth, SearchSettings(method_named("hybrid"), 2, seed=0))
    if not lag:
        assert with_lag is None
    else:
        assert with_lag is not None
        assert with_lag.residual_variance < 0.8 * truth.residual_variance


def test_no_lag_is_suspected_for_a_unit_with_a_learned_model_error() -> None:
    # The residual of the model in the ripple has its own directions.
    error = ChannelError(floor=0.02, correlation_time=1e-3, scatter=0.1, recordings=3)
    calibrated = THESIS.model_copy(update={"model_error": ModelError(current_A=error)})
    assert not is_lag_suspected(at_the_truth(2e-5, calibrated), seed=0)
