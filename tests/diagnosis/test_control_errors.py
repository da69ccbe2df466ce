"""Controller gains that deviate from the description: estimated with the faults, which are not biased."""

import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cases import THESIS, differing, on_a_rig
from emaphm.actuator import Actuator, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.diagnosis import diagnose, error_percent
from emaphm.diagnosis.explanation.other_drive import GAINS, other_drive
from emaphm.diagnosis.joint import diagnose_joint
from emaphm.diagnosis.selection import nuisance_selection
from emaphm.diagnosis.selection.control_errors import (
    CONTROL,
    as_described,
    contradicted_control,
    with_control_errors,
    with_control_law,
)
from emaphm.diagnosis.selection.description_errors import with_free
from emaphm.diagnosis.selection.nuisance_selection import select_nuisances
from emaphm.diagnosis.selection.residual_share import share_of_residual
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.settings import CURRENT_CONTROL, SELECTION, SENSOR_SELECTION
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.recording import Recording
from simulation.rig import altered

DURATION = 0.2
"""Duration of most recordings [s]."""

PMSM, SIX_STEP = Actuator.pmsm(), Actuator.six_step()
FAULTS = Faults(0.3, 0.4, 0.1, 0.25, 0.2, 0.35, 0.7, 0.4)


SETTINGS = SearchSettings(method_named("hybrid"), 2, seed=0)


@cache
def near_the_truth(unit: Actuator, described: Actuator, duration: float = DURATION) -> SearchResult:
    """Return the estimate by the actuator `described` near the true faults of a `unit`."""
    problem = problem_of(on_a_rig(unit, FAULTS, duration), described, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    return correct_bias(objective, objective.space.points(FAULTS.vector[np.newaxis]), 2, seed=0)


@pytest.mark.parametrize("described", [PMSM, SIX_STEP], ids=lambda actuator: actuator.name)
def test_gains_of_the_current_control_are_contradicted_only_if_they_deviate(described: Actuator) -> None:
    assert contradicted_control(near_the_truth(described, described), seed=0) == ()
    contradicted = contradicted_control(
        near_the_truth(differing(described, current_gain=1.1), described), seed=0
    )
    assert contradicted == CURRENT_CONTROL


def test_only_gains_without_a_tolerance_are_checked() -> None:
    assert as_described(near_the_truth(THESIS, THESIS).objective, CONTROL) == ("speed_gain",)
    tolerant = Actuator.from_dict(PMSM.model_dump(exclude_none=True) | {"tolerances": {"current_gain": 0.3}})
    result = near_the_truth(differing(PMSM, current_gain=1.1), tolerant)
    assert as_described(result.objective, CONTROL) == ("speed_gain", "current_integral_gain")


@pytest.mark.usefixtures("unrefined")
@pytest.mark.parametrize(
    ("described", "factors"),
    [
        (THESIS, {"speed_gain": 1.3}),
        pytest.param(PMSM, {"current_gain": 1.2, "current_integral_gain": 0.9}, marks=pytest.mark.evidence),
        pytest.param(SIX_STEP, {"speed_gain": 0.8, "current_gain": 1.2}, marks=pytest.mark.evidence),
    ],
    ids=["speed, hysteresis", "current, field-oriented", "both, six-step"],
)
def test_deviating_gains_are_estimated_with_the_faults(
    described: Actuator, factors: dict[str, float]
) -> None:
    diagnosis = diagnose(on_a_rig(differing(described, **factors), FAULTS, 0.22), described, workers=1)
    assert diagnosis.explained
    assert diagnosis.laws == ()
    assert {f"baseline {name}" for name in factors} <= set(diagnosis.selected)
    for name, factor in factors.items():
        gain = diagnosis.nuisances[f"baseline {name}"]
        assert gain.value == pytest.approx(math.log(factor), abs=max(0.01, 3 * gain.standard_error))
        assert name in "\n".join(diagnosis.notes())
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) < 1.0


def test_with_the_current_alone_a_wrong_gear_ratio_is_not_read_as_a_speed_gain() -> None:
    described = altered(THESIS, mechanics={"gear_ratio": 2 * THESIS.mechanics.gear_ratio})
    recording = on_a_rig(THESIS, Faults(0.3), 0.3)
    objective = faults_objective(problem_of(recording, described, channels=("current_A",)), ("load",))
    start = objective.space.points(
        Faults(0.0, short_a=0.5, short_b=0.5, short_c=0.5, gain=0.05).vector[np.newaxis]
    )
    searched = correct_bias(objective, start, 2, seed=0)
    assert not searched.residual_is_expected
    with_free_gain = with_free(searched, ("speed_gain",), SETTINGS)
    assert with_free_gain.residual_is_expected  # the free gain would explain the recording
    assert with_control_errors(searched, SETTINGS) is searched


def controlled_by(**values: float) -> Actuator:
    """Return the thesis's actuator with more terms in its controller."""
    return THESIS.model_copy(update={"controller": THESIS.controller.model_copy(update=values)})


PARTS = {
    "speed-integral": ("integral_gain", 60 * THESIS.controller.speed_gain),
    "position-integral": ("position_integral_gain", 4.0),
    "feedforward": ("speed_feedforward", 0.4),
    "command-lag": ("command_lag", 1.5e-3),
}


@pytest.mark.parametrize(
    "law",
    [
        "speed-integral",
        # The next test also covers a command that lags.
        *(pytest.param(law, marks=pytest.mark.evidence) for law in PARTS if law != "speed-integral"),
    ],
)
def test_an_undescribed_term_of_the_controller_is_selected_as_a_law(law: str) -> None:
    name, value = PARTS[law]
    searched = near_the_truth(controlled_by(**{name: value}), THESIS, 0.3)
    assert not searched.residual_is_expected
    selection = with_control_law(searched, Selection(searched), SETTINGS)
    assert selection is not None
    result = selection.result
    assert selection.laws == (law,)
    described = lumped_parameters(result.objective.problem.actuator, (name,))[name]
    deviation = result.objective.space.nuisance_values(result.point[np.newaxis])[f"baseline {name}"].item()
    assert described * math.exp(deviation) == pytest.approx(value, rel=0.15)
    assert result.objective.space.faults(result.point) == pytest.approx(FAULTS.vector, abs=0.01)


@pytest.mark.parametrize("lags", [True, False], ids=["command that lags", "channels that are late"])
def test_a_lagging_command_and_delayed_channels_are_distinguished(
    *, lags: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The delay is the best candidate: the residuals with other nuisances are not evaluated here.
    monkeypatch.setattr(nuisance_selection, "SENSOR_SELECTION", replace(SENSOR_SELECTION, most_corrected=1))
    recording = on_a_rig(controlled_by(command_lag=1e-3) if lags else THESIS, FAULTS, DURATION)
    if not lags:
        channels = {name: recording[name] for name in recording.channels}
        late = {name: np.roll(channels[name], 5) for name in ("current_A", "voltage_V")}
        recording = Recording(
            channels | {name: np.r_[np.zeros(5), row_values[5:]] for name, row_values in late.items()}
        )
    problem = problem_of(recording, THESIS, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    searched = correct_bias(objective, objective.space.points(FAULTS.vector[np.newaxis]), 2, seed=0)
    selected = select_nuisances(searched, SETTINGS)
    assert selected.result.residual_is_expected
    assert "delay" in selected.nuisances
    with_lag = with_control_law(searched, selected, SETTINGS)
    share = share_of_residual(with_lag.result, selected.result) if with_lag else math.inf
    assert (share < SELECTION.likely_share) == lags


@pytest.mark.evidence
def test_a_gain_is_undecided_where_early_channels_explain_as_much_as_feedforward() -> None:
    diagnosis = diagnose(
        on_a_rig(controlled_by(speed_feedforward=0.3), Faults(0.3, short_b=0.2), 0.3), THESIS
    )
    assert diagnosis.explained
    assert "delay" in diagnosis.selected
    assert diagnosis.components["gain"].verdict == "cannot tell"
    assert diagnosis.components["friction"].verdict == "degraded"


@pytest.mark.evidence
def test_recordings_of_one_unit_share_deviating_gains() -> None:
    unit = differing(PMSM, current_gain=1.2)
    diagnosis = diagnose_joint([on_a_rig(unit, FAULTS, time) for time in (0.2, 0.25)], PMSM, workers=1)
    assert diagnosis.explained
    assert diagnosis.selected == tuple(f"baseline {name}" for name in CURRENT_CONTROL)
    assert error_percent(FAULTS.vector, diagnosis.faults.vector) < 0.5


@pytest.mark.parametrize(
    ("plant", "described"), [(SIX_STEP, THESIS), (THESIS, SIX_STEP)], ids=["six-step", "hysteresis"]
)
def test_a_drive_of_another_kind_is_named_with_its_gains(plant: Actuator, described: Actuator) -> None:
    result = near_the_truth(plant, described)
    (reason,) = other_drive(result, result, SETTINGS)
    assert f"kind '{plant.drive_kind}'" in reason
    for name, value in lumped_parameters(plant, GAINS[plant.drive_kind]).items():
        stated = re.search(rf"{name} ([0-9.e+]+)", reason)
        assert stated is not None
        assert float(stated[1]) == pytest.approx(value, rel=0.1)


def test_no_other_drive_is_named_for_the_right_kind() -> None:
    lossy = differing(THESIS, coulomb=3.0)
    result = near_the_truth(lossy, THESIS)
    assert other_drive(result, result, SETTINGS) == ()
    field_oriented = near_the_truth(PMSM, PMSM)
    assert other_drive(field_oriented, field_oriented, SETTINGS) == ()
