"""Spoilt recordings: classes of defects, judgement of outcomes, resumption of the study, and its page."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.diagnosis import Diagnosis
from emaphm.diagnosis.verdict import Estimate, Verdict
from emaphm.errors import StudyError
from emaphm.report.spoilt_page import spoilt_page, write_spoilt_page
from emaphm.study import sensor_errors
from emaphm.study.spoilt import changes
from emaphm.study.spoilt.classes import CLASSES
from emaphm.study.spoilt.judging import UNDETECTED_ERROR, judged, wrong_components
from emaphm.study.spoilt.run import SpoiltCase, cases, perform, results, run, spoilt, tasks
from emaphm.study.spoilt.source import CHANNELS

ROWS = 40
COLUMNS = {
    "time_s": np.arange(ROWS) * 1e-3,
    "command_rad": np.linspace(0.0, 1.0, ROWS),
    "current_A": np.sin(np.arange(ROWS) / 3.0),
}


def test_classes_have_distinct_names_and_known_sets() -> None:
    assert len({spoilt_class.name for spoilt_class in CLASSES}) == len(CLASSES)
    assert {name for spoilt_class in CLASSES for name in spoilt_class.sets} == set(CHANNELS)


def test_each_class_is_tried_on_all_its_sets_and_faults() -> None:
    all_cases = cases()
    assert len(set(all_cases)) == len(all_cases) > 536
    assert len(cases(share=0.2)) * 5 == len(all_cases)
    assert {case.spoilt_class for case in cases(only="delay")} < {defect.name for defect in CLASSES}


def test_an_unknown_class_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(StudyError, match="did you mean 'voltage zero'"):
        cases(only="voltage zeros")


def test_a_late_column_has_earlier_values() -> None:
    shifted = changes.late(3)(COLUMNS, np.random.default_rng(0))
    np.testing.assert_array_equal(shifted["current_A"][3:], COLUMNS["current_A"][:-3])
    np.testing.assert_array_equal(shifted["command_rad"], COLUMNS["command_rad"])
    early = changes.late(-3)(COLUMNS, np.random.default_rng(0))
    np.testing.assert_array_equal(early["current_A"][:-3], COLUMNS["current_A"][3:])


def test_spikes_change_the_requested_number_of_rows() -> None:
    spiky = changes.spikes("current_A", 22.0, 5)(COLUMNS, np.random.default_rng(0))["current_A"]
    assert np.sum(spiky != COLUMNS["current_A"]) == 5
    assert np.abs(spiky).max() == 22.0


def test_a_spoilt_case_is_the_same_each_time() -> None:
    case = SpoiltCase("five spikes of 22 A", "current", "short", 2)
    first, second = spoilt(case)[0], spoilt(case)[0]
    np.testing.assert_array_equal(first["current_A"], second["current_A"])


def test_the_number_of_pole_pairs_stays_an_integer() -> None:
    _, actuator, _ = spoilt(SpoiltCase("pole pairs × 2", "current", "healthy", 0))
    assert actuator.electrical is not None
    assert isinstance(actuator.electrical.pole_pairs, int)


@pytest.fixture(scope="module")
def diagnosed() -> Diagnosis:
    """Return a constructed diagnosis of eight components, each known to a hundredth."""
    values = dict(zip(NAMES, Faults(friction=0.2, eccentricity=0.3, gain=0.6).vector, strict=True))
    return Diagnosis(
        components={name: _estimate(float(v), 0.01, "degraded") for name, v in values.items()},
        coordinates=(),
        covariance=np.zeros((0, 0)),
        method="hybrid",
        model="averaged",
        fitness_name="least_squares",
        fitness=0.0,
        residual_rms_A=0.0,
        explained=True,
        evaluations=0,
        reference_runs=0,
        seconds=0.0,
        seed=0,
        recording="made by hand",
        actuator=Actuator.thesis(),
        version="",
        time_s=COLUMNS["time_s"],
        recorded=COLUMNS["current_A"],
        modelled=COLUMNS["current_A"],
    )


def _estimate(value: float, half_width: float, verdict: Verdict) -> Estimate:
    interval = (value - half_width, value + half_width)
    return Estimate(value, half_width / 2, interval, identifiable=True, verdict=verdict)


def _with(diagnosis: Diagnosis, value: float, half_width: float, verdict: Verdict) -> Diagnosis:
    estimate = _estimate(value, half_width, verdict)
    return replace(diagnosis, components={**diagnosis.components, "gain": estimate})


def test_only_a_definite_verdict_with_a_large_error_is_an_undetected_error(diagnosed: Diagnosis) -> None:
    def outcome(value: float, half_width: float, verdict: Verdict) -> str:
        return str(judged(_with(diagnosed, value, half_width, verdict), diagnosed.faults)["outcome"])

    true = diagnosed.faults.gain
    assert outcome(true + 0.05, 0.01, "degraded") == UNDETECTED_ERROR
    assert outcome(true + 0.05, 0.03, "degraded") == "right"  # within two half-widths
    assert outcome(true + 0.025, 0.005, "degraded") == "right"  # below the smallest error that counts
    assert outcome(true + 0.05, 0.01, "cannot tell") != UNDETECTED_ERROR


def test_the_direction_is_never_wrong_without_eccentricity(diagnosed: Diagnosis) -> None:
    direction = _estimate(0.9, 0.01, "degraded")
    with_direction = replace(diagnosed, components={**diagnosed.components, "eccentricity_phase": direction})
    truth = Faults(*(0.0 if name == "eccentricity" else v for name, v in vars(diagnosed.faults).items()))
    assert "eccentricity_phase" not in wrong_components(with_direction, truth)


@pytest.mark.parametrize("name", ["gain", "eccentricity_phase"])
@pytest.mark.parametrize("identifiable", [True, False])
@pytest.mark.parametrize("explained", [True, False])
def test_the_study_of_sensor_errors_uses_the_same_definition_of_wrong(
    diagnosed: Diagnosis, name: str, identifiable: bool, explained: bool
) -> None:
    off = replace(
        _estimate(getattr(diagnosed.faults, name) + 0.1, 0.01, "degraded"), identifiable=identifiable
    )
    spoilt_one = replace(diagnosed, components={**diagnosed.components, name: off}, explained=explained)
    result = sensor_errors.judged(spoilt_one, diagnosed.faults, None, None)
    assert result.wrong == ((name,) if identifiable and explained else ())
    assert (judged(spoilt_one, diagnosed.faults)["outcome"] == UNDETECTED_ERROR) == bool(result.wrong)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("0", "0 cases: give 1 or more"),
        ("1 --first -1", "--first -1: give 0 or more"),
        ("1 --channels voltage_V", "'current_A' is missing"),
        ("1 --sensor position_rad --channels current_A", "--sensor position_rad: is not recorded"),
    ],
)
def test_arguments_without_recordings_to_judge_are_refused(
    arguments: str, message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["sensor_errors", *arguments.split()])
    with pytest.raises(SystemExit):
        sensor_errors.main()
    assert message in capsys.readouterr().err


def test_a_refused_recording_is_an_outcome_and_not_a_failure() -> None:
    case = SpoiltCase("lengths in milliradians", "voltage", "healthy", 0)
    result = perform(case, _revision())
    assert result["outcome"] == "refused"
    assert "milliradians" in result["refusal"]


def test_results_are_stored_and_printed(tmp_path: Path) -> None:
    chosen = (
        SpoiltCase("lengths in milliradians", "voltage", "healthy", 0),
        SpoiltCase("current in kA", "motion", "healthy", 0),
    )
    run(tmp_path, chosen[:1], workers=1)
    assert list(results(tmp_path, chosen)) == [chosen[0]]
    run(tmp_path, chosen, workers=1)
    table = results(tmp_path, chosen)
    assert list(table) == list(chosen)
    page = spoilt_page(table, 2)
    assert "| lengths in milliradians | 1 | 1 |" in page
    assert "None." in page
    assert "not complete" in spoilt_page(table, 3)


def test_a_page_is_not_replaced_where_there_are_no_results(tmp_path: Path) -> None:
    page = tmp_path / "spoilt.md"
    page.write_text("of another study", encoding="utf-8")
    with pytest.raises(StudyError, match=r"absent: no results .* emaphm\.study\.spoilt"):
        write_spoilt_page(tmp_path / "absent", tmp_path)
    assert page.read_text(encoding="utf-8") == "of another study"


def _revision() -> str:
    return str(tasks((SpoiltCase("as recorded", "current", "healthy", 0),))[0].arguments[1])
