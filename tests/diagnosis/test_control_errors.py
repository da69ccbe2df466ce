"""Gains of the control that are not as described: found with the faults, which do not take them up."""

import math
import re

import numpy as np
import pytest

from cases import THESIS, on_a_rig
from emaphm.actuator import Actuator, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.diagnosis import diagnose, error_percent
from emaphm.diagnosis.explanation.other_drive import GAINS, other_drive
from emaphm.diagnosis.joint import diagnose_joint
from emaphm.diagnosis.selection.control_errors import CONTROL, as_described, contradicted_control
from emaphm.diagnosis.selection.settings import CURRENT_CONTROL
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult

PMSM, SIX_STEP = Actuator.pmsm(), Actuator.six_step()
FAULTS = Faults(0.3, 0.4, 0.1, 0.25, 0.2, 0.35, 0.7, 0.4)


def differing(actuator: Actuator, **factors: float) -> Actuator:
    """Return an actuator with parameters `factors` times as large."""
    described = lumped_parameters(actuator, tuple(factors))
    return with_lumped_parameters(actuator, {name: described[name] * one for name, one in factors.items()})


def near_the_truth(unit: Actuator, described: Actuator) -> SearchResult:
    """Return the estimate of what is `described`, next to the true faults of a `unit`."""
    problem = Problem.of(on_a_rig(unit, FAULTS, 0.3), described, channels=("current_A", "voltage_V"))
    objective = faults_objective(problem, ("load",))
    return correct_bias(objective, objective.space.points(FAULTS.vector[np.newaxis]), 2, seed=0)


@pytest.mark.parametrize("described", [PMSM, SIX_STEP], ids=lambda one: one.name)
def test_the_residual_shows_gains_of_the_current_control_only_if_they_are_off(described: Actuator) -> None:
    assert contradicted_control(near_the_truth(described, described), seed=0) == ()
    shown = contradicted_control(near_the_truth(differing(described, current_gain=1.1), described), seed=0)
    assert shown == CURRENT_CONTROL


def test_gains_are_asked_for_only_where_they_rest_on_the_description() -> None:
    assert as_described(near_the_truth(THESIS, THESIS).objective, CONTROL) == ("speed_gain",)
    tolerant = Actuator.from_dict(PMSM.model_dump(exclude_none=True) | {"tolerances": {"current_gain": 0.3}})
    result = near_the_truth(differing(PMSM, current_gain=1.1), tolerant)
    assert as_described(result.objective, CONTROL) == ("speed_gain", "current_integral_gain")


@pytest.mark.parametrize(
    ("described", "factors"),
    [
        (THESIS, {"speed_gain": 1.3}),
        (PMSM, {"current_gain": 1.2, "current_integral_gain": 0.9}),
        (SIX_STEP, {"speed_gain": 0.8, "current_gain": 1.2}),
    ],
    ids=["speed, hysteresis", "current, field-oriented", "both, six-step"],
)
def test_gains_that_are_off_are_estimated_with_the_faults(
    described: Actuator, factors: dict[str, float]
) -> None:
    found = diagnose(on_a_rig(differing(described, **factors), FAULTS, 0.3), described, workers=1)
    assert found.explained
    assert found.laws == ()
    assert {f"baseline {name}" for name in factors} <= set(found.selected)
    for name, factor in factors.items():
        gain = found.nuisances[f"baseline {name}"]
        assert gain.value == pytest.approx(math.log(factor), abs=max(0.01, 3 * gain.standard_error))
        assert name in "\n".join(found.notes())
    assert error_percent(FAULTS.vector, found.faults.vector) < 1.0


def test_an_integral_part_that_nobody_described_is_a_law() -> None:
    described = THESIS.controller.speed_gain
    unit = THESIS.model_copy(
        update={"controller": THESIS.controller.model_copy(update={"integral_gain": 20 * described})}
    )
    found = diagnose(on_a_rig(unit, FAULTS, 0.3), THESIS, workers=1)
    assert found.explained
    assert found.laws == ("speed-integral",)
    # The law starts from 30 /s; its deviation is of the logarithm.
    value = found.nuisances["baseline integral_gain"]
    assert value.value == pytest.approx(math.log(20 / 30), abs=3 * value.standard_error)
    assert error_percent(FAULTS.vector, found.faults.vector) < 1.5


def test_recordings_of_one_unit_share_its_gains() -> None:
    unit = differing(PMSM, current_gain=1.2)
    found = diagnose_joint([on_a_rig(unit, FAULTS, time) for time in (0.2, 0.25)], PMSM, workers=1)
    assert found.explained
    assert found.selected == tuple(f"baseline {name}" for name in CURRENT_CONTROL)
    assert error_percent(FAULTS.vector, found.faults.vector) < 0.5


@pytest.mark.parametrize(
    ("plant", "described"), [(SIX_STEP, THESIS), (THESIS, SIX_STEP)], ids=["six-step", "hysteresis"]
)
def test_a_drive_of_another_kind_is_named_with_its_gains(plant: Actuator, described: Actuator) -> None:
    found = near_the_truth(plant, described)
    (reason,) = other_drive(found, found, method_named("hybrid"), 2, seed=0)
    assert f"kind '{plant.drive_kind}'" in reason
    for name, value in lumped_parameters(plant, GAINS[plant.drive_kind]).items():
        shown = re.search(rf"{name} ([0-9.e+]+)", reason)
        assert shown is not None
        assert float(shown[1]) == pytest.approx(value, rel=0.1)


def test_no_other_drive_is_named_where_the_kind_is_right() -> None:
    lossy = differing(THESIS, coulomb=3.0)
    found = near_the_truth(lossy, THESIS)
    assert other_drive(found, found, method_named("hybrid"), 2, seed=0) == ()
    field_oriented = near_the_truth(PMSM, PMSM)
    assert other_drive(field_oriented, field_oriented, method_named("hybrid"), 2, seed=0) == ()
