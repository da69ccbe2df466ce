"""Notes on a description that deviates from those of the other units of its part number."""

from dataclasses import replace
from pathlib import Path

import pytest

from cases import THESIS
from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.actuator.toml import write_toml
from emaphm.errors import HistoryError
from emaphm.history import History
from emaphm.history.notes.descriptions import unlike_others
from emaphm.history.storage.tables import DESCRIPTIONS
from emaphm.prognosis import Evidence

from . import made_up


@pytest.mark.parametrize("factor", [0.6, 1.0, 1.9])
def test_usual_differences_between_units_of_a_part_number_are_not_noted(factor: float) -> None:
    own = with_lumped_parameters(THESIS, {"coulomb": factor * 0.08, "viscous": factor * 2e-5})
    usual = with_lumped_parameters(THESIS, {"coulomb": 0.08, "viscous": 2e-5})
    assert unlike_others(toml(own), [toml(usual)]) == ()


@pytest.mark.parametrize("factor", [0.3, 5.0])
def test_a_parameter_outside_the_range_of_the_other_units_is_noted_with_that_range(factor: float) -> None:
    inertias = [with_lumped_parameters(THESIS, {"inertia": 1e-5 * scale}) for scale in (1.0, 1.25)]
    own = with_lumped_parameters(THESIS, {"inertia": 1e-5 * factor})
    (note,) = unlike_others(toml(own), list(map(toml, inertias)))
    assert f"inertia {1e-5 * factor:.3g} instead of 1e-05 to 1.25e-05 kg·m²" in note
    assert "--actuator" in note


def test_a_single_unit_and_units_with_equal_descriptions_have_no_note() -> None:
    assert unlike_others(toml(THESIS), []) == ()
    assert unlike_others(toml(THESIS), [toml(THESIS)]) == ()


def test_a_description_that_this_version_cannot_read_is_not_compared() -> None:
    newer = toml(THESIS).replace("inertia_motor", "inertia_of_a_newer_version")
    assert unlike_others(toml(THESIS), [newer]) == ()
    assert unlike_others(newer, [toml(THESIS)]) == ()


def test_a_unit_whose_description_cannot_be_read_is_named_with_the_remedy(tmp_path: Path) -> None:
    with History.open(tmp_path / "newer.sqlite", create=True) as history:
        history.add(made_up.entry("S1", 100.0), made_up.recording(0), made_up.diagnosis(0))
        newer = DESCRIPTIONS.update().values(
            toml=toml(THESIS).replace("inertia_motor", "inertia_of_a_newer_version")
        )
        with history.database.writing() as connection:
            connection.execute(newer)
        unit = history.unit("S1")
        assert Evidence.of(unit).description_notes == ()  # its diagnoses serve other units' priors
        with pytest.raises(HistoryError, match=r"description kept of unit 'S1'.*update emaphm"):
            _ = unit.actuator


def test_the_evidence_of_a_unit_contains_the_note(tmp_path: Path) -> None:
    foreign = with_lumped_parameters(THESIS, {"inertia": 1e-3})
    with History.open(tmp_path / "mixed.sqlite", create=True) as history:
        for number, (name, actuator) in enumerate({"S1": THESIS, "S2": THESIS, "S3": foreign}.items()):
            result = replace(made_up.diagnosis(number), actuator=actuator)
            history.add(made_up.entry(name, 100.0), made_up.recording(number), result, actuator)
        assert [len(Evidence.of(unit).description_notes) for unit in history.units()] == [0, 0, 1]


def toml(actuator: Actuator) -> str:
    """Return the actuator as TOML, the form in which a history stores it."""
    return write_toml(actuator)
