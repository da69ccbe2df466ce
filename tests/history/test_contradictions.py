"""Notes on findings and replacements that the diagnoses of a unit contradict."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import Faults
from emaphm.history import Finding, History, KeptDiagnosis, Removal
from emaphm.history.blocks import unit_blocks
from emaphm.history.notes.contradictions import contradictions
from emaphm.prognosis import Evidence
from emaphm.prognosis.notes.repairs import repair_notes

from . import made_up

ERROR = 0.005


def diagnosed(
    history: History, number: int, hours: float, friction: float, *, explained: bool = True
) -> None:
    """Add a diagnosis with a friction level and the matching verdict; other components are healthy."""
    level = Faults(friction=friction).vector
    result = made_up.diagnosis(number, explained=explained)
    components = {
        name: replace(
            estimate,
            value=float(value),
            standard_error=ERROR,
            interval95=(value - 2 * ERROR, value + 2 * ERROR),
            verdict="degraded" if name == "friction" and friction > 0.05 else "healthy",
        )
        for (name, estimate), value in zip(result.components.items(), level, strict=True)
    }
    covariance = ERROR**2 * np.eye(len(result.coordinates))
    result = replace(result, components=components, covariance=covariance)
    history.add(made_up.entry("S1", hours), made_up.recording(number), result)


@pytest.fixture
def worn(tmp_path: Path) -> tuple[KeptDiagnosis, ...]:
    """Return diagnoses at 100, 200 and 300 h, of a friction of 0.1, 0.2 and 0.3."""
    with History.open(tmp_path / "worn.sqlite", create=True) as history:
        for i in (1, 2, 3):
            diagnosed(history, i, 100.0 * i, 0.1 * i)
        return history.unit("S1").diagnoses()


@pytest.mark.parametrize(
    ("finding", "said"),
    [
        (Finding(300.0, "friction", "healthy"), "friction was found healthy at 300 h"),
        (Finding(300.0, "unit", "healthy"), "unit was found healthy at 300 h"),
        (Finding(300.0, "backlash", "degraded"), "backlash 0.000 (95 %"),
        (Finding(300.0, "friction", "degraded", 0.45), "with a level of 0.45"),
        (Finding(300.0, "friction", "degraded", 0.15), "with a level of 0.15"),
        # The first level is within a shop's measurement error, the second after plausible further wear.
        (Finding(300.0, "friction", "degraded", 0.33), None),
        (Finding(350.0, "friction", "degraded", 0.45), None),
        (Finding(350.0, "friction", "degraded", 0.6), "with a level of 0.6"),
        (Finding(300.0, "friction", "failed"), None),
        (Finding(300.0, "unit", "failed"), None),
        (Finding(300.0, "backlash", "healthy"), None),
        (Finding(300.0, "friction", "degraded", replaced=True), None),
        # There is no diagnosis before these hours.
        (Finding(50.0, "friction", "healthy"), None),
    ],
)
def test_a_finding_that_contradicts_the_last_diagnosis_is_noted(
    worn: tuple[KeptDiagnosis, ...], finding: Finding, said: str | None
) -> None:
    notes = contradictions(worn, [finding])
    assert len(notes) == (said is not None)
    if said is not None:
        assert said in notes[0]
        assert "the diagnosis of 300 h has" in notes[0]
        assert "forecasts still follow the diagnoses" in notes[0]


def test_a_unit_found_failed_contradicts_diagnoses_of_healthy_components(tmp_path: Path) -> None:
    with History.open(tmp_path / "new.sqlite", create=True) as history:
        diagnosed(history, 1, 100.0, 0.0)
        unit = history.unit("S1")
        (note,) = contradictions(unit.diagnoses(), [Finding(110.0, "unit", "failed")])
        assert "unit was found failed at 110 h" in note
        assert "it still counts as failed" in note
        diagnosed(history, 2, 105.0, 0.0, explained=False)
        # The newest recording is not explained, so it may contain the failure that the shop found.
        assert contradictions(unit.diagnoses(), [Finding(110.0, "unit", "failed")]) == ()


def test_a_level_unchanged_by_a_replacement_is_noted_in_all_outputs(
    tmp_path: Path, worn: tuple[KeptDiagnosis, ...]
) -> None:
    replaced = Finding(300.0, "friction", "degraded", replaced=True)
    with History.open(tmp_path / "worn.sqlite") as history:
        history.add_finding("S1", replaced)
        unit = history.unit("S1")
        assert contradictions(worn, unit.findings()) == ()
        diagnosed(history, 4, 310.0, 0.3)
        (note,) = contradictions(unit.diagnoses(), unit.findings())
        assert "friction was replaced at 300 h, but the diagnosis of 310 h has 0.300" in note
        assert repair_notes(Evidence.of(unit)) == [note]
        assert unit_blocks(unit)["notes"] == [note]


@pytest.mark.parametrize(("hours", "friction"), [(310.0, 0.1), (310.0, 0.0), (600.0, 0.3)])
def test_a_new_part_with_plausible_wear_is_not_noted(
    tmp_path: Path, worn: tuple[KeptDiagnosis, ...], hours: float, friction: float
) -> None:
    replaced = Finding(300.0, "unit", "degraded", replaced=True)
    with History.open(tmp_path / "worn.sqlite") as history:
        diagnosed(history, 4, hours, friction)
        assert contradictions(history.unit("S1").diagnoses(), [replaced]) == ()
    assert worn


def test_all_outputs_have_the_hours_of_the_latest_entry_of_a_unit(
    tmp_path: Path, worn: tuple[KeptDiagnosis, ...]
) -> None:
    def hours(history: History) -> set[float]:
        unit = history.unit("S1")
        (state,) = history.states()
        ends = [unit.lives()[-1].end_hours, unit.lives("gain")[-1].end_hours]
        return {state.hours, Evidence.of(unit).hours, unit_blocks(unit)["unit"]["hours"], *ends}

    with History.open(tmp_path / "worn.sqlite") as history:
        assert hours(history) == {worn[-1].hours}
        history.add_finding("S1", Finding(320.0, "backlash", "healthy"))
        assert hours(history) == {320.0}
        history.add_removal("S1", Removal(330.0, "scheduled"))
        assert hours(history) == {330.0}
