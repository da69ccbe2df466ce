"""Laws that the description lacks are selected, and faults are estimated with them."""

import json
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cases import THESIS, drawn, on_a_rig, reference_recordings
from emaphm.actuator import NAMES, Chirp, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.diagnosis import Diagnosis, diagnose, error_percent
from emaphm.diagnosis.diagnose import SEARCH_SHARE
from emaphm.diagnosis.selection import control_errors, first_look
from emaphm.diagnosis.selection.laws import law_fit, law_selection, sensor_lag
from emaphm.diagnosis.selection.laws.law_fit import ONLY_WHILE_SWITCHING, acts, with_law, without_law
from emaphm.diagnosis.selection.laws.law_selection import SUSPECTS, select_laws
from emaphm.diagnosis.selection.residual_share import hopelessness_relative_to
from emaphm.diagnosis.selection.selection import Selection
from emaphm.diagnosis.selection.settings import SENSOR_SELECTION
from emaphm.diagnosis.verdict import NOT_EXPLAINED
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

pytestmark = pytest.mark.usefixtures("one_search", "unrefined")

SPEED = 20.0
STRIBECK = with_lumped_parameters(LAWS["stribeck"].added_to(THESIS), {"stribeck_speed": SPEED})
TRUTH = Faults(friction=0.3, backlash=0.2, short_b=0.25, gain=0.6)
SOUND = ("short_a", "short_c", "eccentricity")
SETTINGS = SearchSettings(method_named("hybrid"), 2, seed=0)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Return a recording of an actuator with Stribeck friction, with noise and converters."""
    command = Chirp(duration=0.2)
    whole = simulate(STRIBECK, command, faults=TRUTH, duration=0.2, noise=0.05, adc_bits=12)
    return Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})


@pytest.fixture(scope="module")
def progress() -> list[float]:
    """Return the progress that the diagnosis of `recording` reports."""
    return []


@pytest.fixture(scope="module")
def diagnosis(recording: Recording, progress: list[float]) -> Iterator[Diagnosis]:
    """Return its diagnosis by the description without the law; few alternatives are evaluated, to save time.

    A lag of the current sensors is not evaluated: with each law it requires further compiled kernels.
    """
    with pytest.MonkeyPatch.context() as patched:
        for constant in ("SUSPECTS", "FRICTION_CURVES"):
            patched.setattr(law_selection, constant, ("stribeck", "directional"))
        patched.setattr(control_errors, "CONTROL_LAWS", ("speed-integral",))
        for module in (first_look, sensor_lag):
            patched.setattr(module, "can_show_lag", lambda _: False)
        few = replace(SENSOR_SELECTION, most_corrected=1)
        patched.setattr("emaphm.diagnosis.selection.nuisance_selection.SENSOR_SELECTION", few)
        yield diagnose(recording, THESIS, max_corrections=1, on_progress=progress.append)


def test_the_law_is_named_and_its_parameter_estimated(diagnosis: Diagnosis) -> None:
    assert diagnosis.laws == ("stribeck",)
    assert diagnosis.explained
    assert json.loads(json.dumps(diagnosis.to_dict()))["laws"] == ["stribeck"]
    assert "Explained best by laws that the description lacks: stribeck; without them" in str(diagnosis)
    assert "emaphm calibrate --laws stribeck)." in str(diagnosis)
    # The value is that of the parameter in its unit, and not a deviation.
    speed = diagnosis.law_parameters["stribeck_speed"]
    assert abs(speed.value - SPEED) <= 4 * speed.standard_error
    assert f"Found: stribeck_speed {speed}." in str(diagnosis)
    assert speed.unit == "rad/s"
    assert str(diagnosis).count("stribeck_speed") == 1
    assert diagnosis.to_dict()["law_parameters"]["stribeck_speed"]["value"] == speed.value


def test_a_law_is_proposed_only_if_it_explains_and_its_parameter_is_known(diagnosis: Diagnosis) -> None:
    unexplained = replace(diagnosis, explained=False).with_laws(diagnosis.laws)
    assert unexplained.laws == ()
    assert not any("stribeck" in name for name in unexplained.to_dict()["nuisances"])
    unknown_values = {name: replace(result, known=False) for name, result in diagnosis.nuisances.items()}
    unknown = replace(diagnosis, nuisances=unknown_values).with_laws(diagnosis.laws)
    for result in (unexplained, unknown):
        assert result.law_parameters == {}
        assert "emaphm calibrate --laws" not in str(result)
    assert diagnosis.with_laws(diagnosis.laws).laws == diagnosis.laws


def test_faults_are_estimated_with_the_law(diagnosis: Diagnosis) -> None:
    assert error_percent(TRUTH.vector, diagnosis.faults.vector) <= 1.5
    for name in SOUND:
        assert diagnosis.components[name].verdict != "degraded"
    for name in ("friction", "backlash", "short_b", "gain"):
        assert diagnosis.components[name].verdict == "degraded"


@pytest.mark.usefixtures("diagnosis")
def test_progress_is_reported_for_the_steps_after_the_search(progress: list[float]) -> None:
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    assert sum(SEARCH_SHARE < done < 1.0 for done in progress) >= 3


def test_without_the_law_no_component_has_a_verdict(recording: Recording) -> None:
    without_law = diagnose(recording, THESIS, nuisances=THESIS.nuisances.estimated)
    assert not without_law.explained
    assert without_law.laws == ()
    # With faults alone, the error by the friction curve is tens of percent.
    assert error_percent(TRUTH.vector, without_law.faults.vector) > 5
    for name in NAMES:
        assert without_law.components[name].verdict == "cannot tell"
        assert without_law.components[name].reason
    assert without_law.components["gain"].reason == NOT_EXPLAINED


@pytest.fixture(scope="module")
def at_the_truth() -> SearchResult:
    truth = drawn(1, seed=7)
    problem = problem_of(reference_recordings(truth, noise=0.05, duration=0.2)[0], THESIS)
    objective = faults_objective(problem, ("load",))
    return with_discrepancy(SearchResult.at(objective, objective.space.points(truth[0])), seed=0)


@pytest.fixture(scope="module")
def astray(at_the_truth: SearchResult) -> SearchResult:
    """Return an estimate that does not explain the recording."""
    objective = at_the_truth.objective
    point_away = objective.space.project(at_the_truth.point + 0.1)
    return with_discrepancy(SearchResult.at(objective, point_away), seed=0)


@pytest.mark.evidence
def test_a_lag_of_the_speed_feedback_is_not_called_backlash(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(law_selection, "SUSPECTS", ("transition", "speed-lag"))
    lagging = with_lumped_parameters(LAWS["speed-lag"].added_to(THESIS), {"speed_lag": 6e-4})
    diagnosis = diagnose(on_a_rig(lagging, Faults(), 0.3), THESIS, max_corrections=5)
    assert diagnosis.laws == ("speed-lag",)
    assert diagnosis.components["backlash"].verdict == "healthy"
    ratio = diagnosis.nuisances["baseline speed_lag"]
    assert abs(ratio.value - np.log(6e-4 / 5e-4)) <= 4 * ratio.standard_error


@pytest.mark.evidence
def test_undescribed_bristles_are_not_called_backlash(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(law_selection, "SUSPECTS", ("transition", "presliding"))
    values = {"presliding_stiffness": 3.0, "presliding_damping": 5e-3}
    bristles = with_lumped_parameters(LAWS["presliding"].added_to(THESIS), values)
    diagnosis = diagnose(on_a_rig(bristles, Faults(0.2), 0.2), THESIS)
    assert diagnosis.explained
    assert diagnosis.laws == ("presliding",)
    assert diagnosis.components["friction"].value == pytest.approx(0.2, abs=0.02)
    assert diagnosis.components["backlash"].verdict == "healthy"


def test_without_an_acting_law_the_search_returns_to_the_description(
    at_the_truth: SearchResult, astray: SearchResult
) -> None:
    objective, truth = at_the_truth.objective, at_the_truth.point
    cogging = with_law(objective, LAWS["cogging"])
    near = cogging.space.carried_over(truth, objective.space)
    with_cogging = with_discrepancy(SearchResult.at(cogging, near), seed=0)
    assert not acts(with_cogging, LAWS["cogging"], seed=0)
    returned = without_law(with_cogging, astray, SETTINGS)
    assert returned.objective.space.coordinates == objective.space.coordinates
    assert returned.residual_is_expected
    assert returned.residual_variance < 0.5 * astray.residual_variance


def test_a_law_that_prevents_the_selection_of_a_better_one_is_left_out(
    at_the_truth: SearchResult, astray: SearchResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not astray.residual_is_expected

    def forward(_: object, allowed: tuple[str, ...]) -> Selection:
        if "presliding" in allowed:
            return Selection(astray, laws=("presliding",))
        return Selection(at_the_truth, laws=("transition",))

    monkeypatch.setattr(law_selection, "SUSPECTS", ("transition", "presliding"))
    monkeypatch.setattr(law_selection, "_forward_selection", forward)
    selection = select_laws(astray, SETTINGS)
    assert selection.laws == ("transition",)
    assert np.array_equal(selection.result.point, at_the_truth.point)
    assert [
        np.array_equal(alternative.point, astray.point) for alternative in selection.result.alternatives
    ] == [True]


@pytest.mark.parametrize("refined", [True, False])
def test_only_a_law_with_a_smaller_residual_is_refined(
    at_the_truth: SearchResult, refined: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    unrefined_result = SimpleNamespace()
    monkeypatch.setattr(law_fit.Fit, "of", lambda *_: SimpleNamespace(corrected=lambda *_: unrefined_result))
    monkeypatch.setattr(
        law_fit, "is_residual_above", lambda candidate, *_: not (refined and candidate is unrefined_result)
    )
    monkeypatch.setattr(law_fit, "refine_by_reference", lambda *_: at_the_truth)
    result = law_fit.search_with(at_the_truth, at_the_truth.objective, "any", SETTINGS)
    assert result is (at_the_truth if refined else unrefined_result)


def test_an_unexplained_result_without_a_clearly_smaller_residual_is_hopeless(
    at_the_truth: SearchResult, astray: SearchResult
) -> None:
    farther = with_discrepancy(
        SearchResult.at(astray.objective, astray.objective.space.project(astray.point + 0.1)), seed=0
    )
    assert hopelessness_relative_to(astray)(astray)
    assert hopelessness_relative_to(astray)(farther)
    assert not hopelessness_relative_to(astray)(at_the_truth)
    # Compared with an explanation, any candidate may be slightly better.
    assert not hopelessness_relative_to(at_the_truth)(astray)


def test_the_scan_of_lags_stops_if_the_first_do_not_reduce_the_residual(
    astray: SearchResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    evaluated = []

    def corrected(fit: law_fit.Fit, *_: object) -> SearchResult:
        evaluated.append(fit.objective.problem.actuator)
        return astray

    monkeypatch.setattr(law_fit.Fit, "corrected", corrected)
    lagging = with_law(astray.objective, LAWS["sensor-lag"])
    fit = law_fit.Fit("sensor-lag", astray, lagging, astray.point[np.newaxis], near=0.0, far=0.0)
    assert sensor_lag.with_best_lag(fit, astray, SETTINGS) is None
    assert len(evaluated) == len(sensor_lag.PROBED_LAGS_S)


def test_the_number_of_threads_does_not_change_the_selection(
    astray: SearchResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(law_selection, "SUSPECTS", ("directional", "quadratic"))
    objective, settings = astray.objective, replace(SETTINGS, max_corrections=1)

    def selected(workers: int) -> Selection:
        by_threads = replace(objective, problem=replace(objective.problem, workers=workers))
        return select_laws(replace(astray, objective=by_threads), settings)

    alone, together = selected(1), selected(3)
    assert alone.laws == together.laws
    np.testing.assert_array_equal(alone.result.point, together.result.point)
    for alternative, alternative_by_threads in zip(
        alone.result.alternatives, together.result.alternatives, strict=True
    ):
        np.testing.assert_array_equal(alternative.point, alternative_by_threads.point)


def test_a_law_with_an_amplitude_acts(at_the_truth: SearchResult) -> None:
    cogging = with_law(at_the_truth.objective, LAWS["cogging"])
    point = cogging.space.carried_over(at_the_truth.point, at_the_truth.objective.space)
    point[-1] += 1.0  # one standard deviation of its prior
    assert acts(with_discrepancy(SearchResult.at(cogging, point), seed=0), LAWS["cogging"], seed=0)


def test_no_law_is_selected_where_the_residual_is_noise(at_the_truth: SearchResult) -> None:
    selection = select_laws(at_the_truth, SETTINGS)
    assert selection.result is at_the_truth
    assert selection.laws == ()


@pytest.mark.parametrize("name", SUSPECTS)
def test_an_added_law_has_free_parameters_after_the_estimated_ones(
    at_the_truth: SearchResult, name: str
) -> None:
    law = LAWS[name]
    before = at_the_truth.objective
    after = with_law(before, law)
    assert law.is_in(after.problem.actuator)
    assert not law.is_in(before.problem.actuator)
    assert after.space.coordinates[: before.space.dimensions] == before.space.coordinates
    added = after.space.coordinates[before.space.dimensions :]
    # A law that acts only within the switching is scanned: the averaged model has no derivative by it.
    assert bool(added) == (name not in ONLY_WHILE_SWITCHING)
    assert len(added) == len(after.space.nuisances.parameters)
    assert set(after.space.nuisances.parameters) <= {*law.parameters, *law.also_free}
    # The rows are the same, so that the costs before and after are comparable.
    np.testing.assert_array_equal(after.problem.recorded, before.problem.recorded)
    assert after.channel_rows == before.channel_rows
    # If the law is added again, no parameter is free twice.
    assert with_law(after, law).space.coordinates == after.space.coordinates
