"""Spoilt recordings: what spoils them, how the outcome is judged, and the study's resuming and page."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.diagnosis import Diagnosis
from emaphm.diagnosis.verdict import Estimate, Verdict
from emaphm.errors import StudyError
from emaphm.report.spoilt_page import spoilt_page
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


def test_classes_have_names_of_their_own_and_known_sets() -> None:
    assert len({one.name for one in CLASSES}) == len(CLASSES)
    assert {name for one in CLASSES for name in one.sets} == set(CHANNELS)


def test_every_class_is_tried_on_all_of_its_sets_and_faults() -> None:
    every = cases()
    assert len(set(every)) == len(every) > 536
    assert len(cases(share=0.2)) * 5 == len(every)
    assert {case.spoilt_class for case in cases(only="delay")} < {one.name for one in CLASSES}


def test_unknown_class_names_the_nearest() -> None:
    with pytest.raises(StudyError, match="did you mean 'voltage zero'"):
        cases(only="voltage zeros")


def test_a_late_column_shows_what_was_before() -> None:
    shifted = changes.late(3)(COLUMNS, np.random.default_rng(0))
    np.testing.assert_array_equal(shifted["current_A"][3:], COLUMNS["current_A"][:-3])
    np.testing.assert_array_equal(shifted["command_rad"], COLUMNS["command_rad"])
    early = changes.late(-3)(COLUMNS, np.random.default_rng(0))
    np.testing.assert_array_equal(early["current_A"][:-3], COLUMNS["current_A"][3:])


def test_spikes_change_as_many_rows_as_asked() -> None:
    spiky = changes.spikes("current_A", 22.0, 5)(COLUMNS, np.random.default_rng(0))["current_A"]
    assert np.sum(spiky != COLUMNS["current_A"]) == 5
    assert np.abs(spiky).max() == 22.0


def test_a_spoilt_case_is_the_same_each_time() -> None:
    case = SpoiltCase("five spikes of 22 A", "current", "short", 2)
    one, other = spoilt(case)[0], spoilt(case)[0]
    np.testing.assert_array_equal(one["current_A"], other["current_A"])


def test_pole_pairs_stay_whole() -> None:
    _, actuator, _ = spoilt(SpoiltCase("pole pairs × 2", "current", "healthy", 0))
    assert actuator.electrical is not None
    assert isinstance(actuator.electrical.pole_pairs, int)


@pytest.fixture(scope="module")
def diagnosed() -> Diagnosis:
    """Return a diagnosis of eight components that are known to a hundredth, made by hand."""
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
    one = _estimate(value, half_width, verdict)
    return replace(diagnosis, components={**diagnosis.components, "gain": one})


def test_only_a_definite_verdict_far_off_is_silently_wrong(diagnosed: Diagnosis) -> None:
    def outcome(value: float, half_width: float, verdict: Verdict) -> str:
        return str(judged(_with(diagnosed, value, half_width, verdict), diagnosed.faults)["outcome"])

    true = diagnosed.faults.gain
    assert outcome(true + 0.05, 0.01, "degraded") == UNDETECTED_ERROR
    assert outcome(true + 0.05, 0.03, "degraded") == "right"  # within two half-widths
    assert outcome(true + 0.025, 0.005, "degraded") == "right"  # smaller than what counts
    assert outcome(true + 0.05, 0.01, "cannot tell") != UNDETECTED_ERROR


def test_the_direction_of_no_eccentricity_is_never_wrong(diagnosed: Diagnosis) -> None:
    direction = _estimate(0.9, 0.01, "degraded")
    with_direction = replace(diagnosed, components={**diagnosed.components, "eccentricity_phase": direction})
    truth = Faults(*(0.0 if name == "eccentricity" else v for name, v in vars(diagnosed.faults).items()))
    assert "eccentricity_phase" not in wrong_components(with_direction, truth)


@pytest.mark.parametrize("name", ["gain", "eccentricity_phase"])
@pytest.mark.parametrize("identifiable", [True, False])
@pytest.mark.parametrize("explained", [True, False])
def test_the_study_of_sensors_calls_the_same_wrong(
    diagnosed: Diagnosis, name: str, identifiable: bool, explained: bool
) -> None:
    off = replace(
        _estimate(getattr(diagnosed.faults, name) + 0.1, 0.01, "degraded"), identifiable=identifiable
    )
    spoilt_one = replace(diagnosed, components={**diagnosed.components, name: off}, explained=explained)
    found = sensor_errors.judged(spoilt_one, diagnosed.faults, None, None)
    assert found.wrong == ((name,) if identifiable and explained else ())
    assert (judged(spoilt_one, diagnosed.faults)["outcome"] == UNDETECTED_ERROR) == bool(found.wrong)


def test_a_refused_recording_is_an_outcome_and_no_failure() -> None:
    case = SpoiltCase("lengths in milliradians", "voltage", "healthy", 0)
    one = perform(case, _revision())
    assert one["outcome"] == "refused"
    assert "milliradians" in one["refusal"]


def test_results_are_kept_and_shown(tmp_path: Path) -> None:
    chosen = (
        SpoiltCase("lengths in milliradians", "voltage", "healthy", 0),
        SpoiltCase("current in kA", "motion", "healthy", 0),
    )
    run(tmp_path, chosen[:1], workers=1)
    assert list(results(tmp_path, chosen)) == [chosen[0]]
    run(tmp_path, chosen, workers=1)
    found = results(tmp_path, chosen)
    assert list(found) == list(chosen)
    page = spoilt_page(found, 2)
    assert "| lengths in milliradians | 1 | 1 |" in page
    assert "None." in page
    assert "not complete" in spoilt_page(found, 3)


def _revision() -> str:
    return str(tasks((SpoiltCase("as recorded", "current", "healthy", 0),))[0].arguments[1])
