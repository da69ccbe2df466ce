"""Laws of losses in motor and inverter: suspected and estimated, although faults could compensate them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cases import THESIS, on_a_rig
from emaphm.actuator import Actuator, Faults, Step
from emaphm.actuator.laws import LAWS, typical_speed
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.diagnosis import diagnose
from emaphm.diagnosis.law_parameters import shown_laws
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.selection import deviations
from emaphm.diagnosis.selection.laws import hidden_laws, law_selection
from emaphm.diagnosis.selection.laws.hidden_laws import (
    HIDDEN,
    Answers,
    Score,
    suspected_laws,
)
from emaphm.diagnosis.selection.laws.law_fit import with_free_law
from emaphm.diagnosis.selection.residual_share import notes_on_alternatives
from emaphm.diagnosis.selection.selection import Selection
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

pytestmark = pytest.mark.usefixtures("one_search", "unrefined")

LIMIT = THESIS.controller.current_limit
FAULTS = Faults(0.3, 0.4, 0.0, 0.25, 0.1, 0.35, 0.7, 0.4)


def with_law(name: str, value: float) -> Actuator:
    law = LAWS[name]
    return with_lumped_parameters(law.added_to(THESIS), {law.parameters[0]: value})


def near_the_truth(recording: Recording, actuator: Actuator = THESIS) -> SearchResult:
    """Return the estimate by `actuator` near the true faults."""
    objective = faults_objective(problem_of(recording, actuator), ("load",))
    return correct_bias(objective, objective.space.points(FAULTS.vector[np.newaxis]), 2, seed=0)


@cache
def estimate_as_described() -> SearchResult:
    """Return the estimate for a unit as described."""
    return near_the_truth(on_a_rig(THESIS, FAULTS, 0.15))


def test_a_law_without_effect_alone_has_no_score_by_the_reference_model() -> None:
    # The command of a step has a rate only in its jump, where the speed demand is at its limit.
    step = simulate(THESIS, Step(start=0.02), duration=0.08, noise=0.05)
    result = near_the_truth(Recording({name: step[name] for name in ("time_s", "command_rad", "current_A")}))
    feedforward = [law for law in HIDDEN if law.name == "feedforward"]
    answers = Answers.of(result, feedforward, seed=0)
    assert answers.scores(answers.jacobian) == {}


@pytest.mark.parametrize("value", [0.01, -0.01])
def test_a_saturation_is_suspected_and_sized(value: float) -> None:
    result = near_the_truth(on_a_rig(with_law("saturation", value), FAULTS, 0.15))
    # A linear step; the other parameters compensate a part.
    assert suspected_laws(result, seed=0)["saturation"].values == pytest.approx([value * LIMIT], rel=0.4)


def test_a_certain_law_with_an_equal_residual_is_an_alternative(monkeypatch: pytest.MonkeyPatch) -> None:
    """Example: a lag of the current control, of which a lag of the speed feedback explains most."""
    result = estimate_as_described()
    with_lag = near_the_truth(on_a_rig(THESIS, FAULTS, 0.15), with_law("speed-lag", 1e-4))
    scores = {"speed-lag": Score(np.array([1e-4]), np.array([[1e-10]]))}
    monkeypatch.setattr(deviations, "suspected_laws", lambda *_: scores)
    monkeypatch.setattr(deviations, "search_with_law", lambda *_: with_lag)
    monkeypatch.setattr(deviations, "without_law", lambda *_: result)
    monkeypatch.setattr(deviations, "acts", lambda *_: True)
    monkeypatch.setattr(
        deviations, "_with_nuisances", lambda selection, laws, *_: Selection(selection, laws=laws)
    )
    for share, kept, alternatives in ((0.9, True, ()), (1.01, False, (with_lag,)), (1.1, False, ())):
        monkeypatch.setattr(
            deviations, "share_of_residual", lambda tried, _, of=share: of if tried is with_lag else 1.0
        )
        monkeypatch.setattr(
            deviations, "suspected_laws", lambda selection, _: {} if selection is with_lag else scores
        )
        settings = SearchSettings(method_named("hybrid"), 2, 0)
        selection = deviations._with_hidden_laws(result, Selection(result), settings)
        assert selection.laws == (("speed-lag",) if kept else ())
        assert selection.result.alternatives == alternatives


def test_an_alternative_law_has_a_note() -> None:
    result = estimate_as_described()
    law = LAWS["cogging"]
    objective = with_free_law(result.objective, law, law.parameters[:4])
    point = objective.space.carried_over(result.point, result.objective.space)
    assert result.discrepancy is not None
    priors = np.zeros(objective.target.size - result.objective.target.size)
    discrepancy = replace(result.discrepancy, mean=np.concatenate([result.discrepancy.mean, priors]))
    other = SearchResult.at(objective, point, discrepancy=discrepancy)
    assert notes_on_alternatives(result) == ()
    (note,) = notes_on_alternatives(replace(result, alternatives=(other,)))
    explanation = "with cogging the recording would be explained equally well"
    assert note == f"{explanation}; the intervals include this alternative"


def test_no_law_is_suspected_for_a_unit_as_described() -> None:
    assert suspected_laws(estimate_as_described(), seed=0) == {}
    described = with_law("saturation", 0.01)
    assert suspected_laws(near_the_truth(on_a_rig(described, FAULTS, 0.15), described), seed=0) == {}


@pytest.mark.evidence
def test_an_undescribed_saturation_is_estimated_and_not_called_a_fault() -> None:
    diagnosis = diagnose(on_a_rig(with_law("saturation", 0.01), Faults(), 0.35), THESIS)
    assert diagnosis.explained
    assert diagnosis.laws == ("saturation",)
    components = {name: one for name, one in diagnosis.components.items() if name != "eccentricity_phase"}
    assert {component.verdict for component in components.values()} == {"healthy"}
    value = diagnosis.nuisances["baseline saturation"]
    assert value.value == pytest.approx(0.01, abs=4 * value.standard_error)
    assert value.standard_error < 0.001


@pytest.mark.parametrize("value", [0.2, -0.1])
def test_a_sine_share_of_the_back_emf_is_suspected_and_sized(value: float) -> None:
    result = near_the_truth(on_a_rig(with_law("emf-sine", value), FAULTS, 0.15))
    assert suspected_laws(result, seed=0)["emf-sine"].values == pytest.approx([value], rel=0.4)


def test_displaced_hall_sensors_are_suspected_and_sized() -> None:
    early = {"hall_a": 0.035, "hall_b": -0.025, "hall_c": 0.02}
    displaced = with_lumped_parameters(LAWS["hall-angles"].added_to(THESIS), early)
    result = near_the_truth(on_a_rig(displaced, FAULTS, 0.15))
    score = suspected_laws(result, seed=0)["hall-angles"]
    assert score.values == pytest.approx([*early.values()], abs=0.015)


def test_late_commutation_is_suspected_and_sized() -> None:
    late = {"commutation_lag": 0.03, "commutation_delay": 3e-5}
    result = near_the_truth(
        on_a_rig(with_lumped_parameters(LAWS["commutation-lag"].added_to(THESIS), late), FAULTS, 0.25)
    )
    values = suspected_laws(result, seed=0)["commutation-lag"].values
    # At nearly equal speeds, only the sum of both is identifiable.
    assert sum(values) == pytest.approx(0.03 + 3e-5 * 2 * typical_speed(THESIS), abs=0.01)


@pytest.mark.evidence
def test_narrow_flats_of_the_back_emf_are_not_called_a_short(monkeypatch: pytest.MonkeyPatch) -> None:
    rivals = ("emf-flats", "emf-sine", "saturation", "inverter-drop")
    monkeypatch.setattr(hidden_laws, "HIDDEN", [law for law in hidden_laws.HIDDEN if law.name in rivals])
    monkeypatch.setattr(law_selection, "SUSPECTS", rivals)
    diagnosis = diagnose(on_a_rig(with_law("emf-flats", 0.35), Faults(0.2, short_b=0.1), 0.15), THESIS)
    assert diagnosis.explained
    assert diagnosis.laws == ("emf-flats",)
    loss = diagnosis.nuisances["baseline flat_loss"]
    assert abs(loss.value - np.log(0.35 / 0.2)) <= 4 * loss.standard_error
    assert loss.standard_error < 0.05
    assert diagnosis.components["friction"].value == pytest.approx(0.2, abs=0.01)
    low, high = diagnosis.components["short_b"].interval95
    assert low <= 0.1 <= high


def test_a_voltage_drop_of_the_inverter_is_not_read_as_inertia() -> None:
    diagnosis = diagnose(on_a_rig(with_law("inverter-drop", 1.0), Faults(0.3), 0.15), THESIS)
    assert diagnosis.explained
    assert diagnosis.laws == ("inverter-drop",)
    assert diagnosis.selected == ()
    assert diagnosis.components["friction"].value == pytest.approx(0.3, abs=0.01)
    drop = diagnosis.nuisances["baseline voltage_drop"]
    assert abs(drop.value - np.log(1.0 / (0.01 * 48.0))) <= 4 * drop.standard_error
    assert drop.standard_error < 0.1


@pytest.mark.parametrize(("size", "named"), [(1.9, False), (2.1, True)])
def test_a_law_that_begins_at_0_is_named_if_a_parameter_is_significant(size: float, named: bool) -> None:
    error = 0.005
    estimate = NuisanceEstimate(size * error, error, "rad", True)
    laws = shown_laws(("hall-angles",), {"baseline hall_a": estimate}, THESIS)
    assert laws == (("hall-angles",) if named else ())


def test_a_law_with_an_effect_at_its_start_is_named_if_a_parameter_is_known() -> None:
    estimate = NuisanceEstimate(0.01, 0.5, "-", True)
    assert shown_laws(("speed-lag",), {"baseline speed_lag": estimate}, THESIS) == ("speed-lag",)
