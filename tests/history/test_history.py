"""Entries of a history are read as added, once each, from SQLite and PostgreSQL."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from emaphm.actuator import COMPONENTS, NAMES
from emaphm.actuator.faults import degraded_in
from emaphm.actuator.law_sections import RippleHarmonic
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.errors import HistoryError, OutputError
from emaphm.history import Entry, Finding, Flight, History, Life, Mistake, Removal, Replacement
from emaphm.history.blocks import METHOD, diagnosis_blocks, unit_blocks
from emaphm.history.export import export
from emaphm.history.kept_prognosis import KeptPrognosis, keep_prognosis
from emaphm.history.views import diagnosis_lines, read_curves
from emaphm.recording import Recording
from emaphm.recording.content import recording_hash

from . import made_up
from .made_up import diagnosis, entry, recording


def fill(history: History, numbers: range, unit: str = "S1") -> None:
    for number in numbers:
        assert history.add(entry(unit, 10.0 * number), recording(number), diagnosis(number)).added


def test_a_stored_diagnosis_is_read_as_added(history: History) -> None:
    assert history.add(Entry("S1", made_up.PART, 10.5, 7, "left"), recording(1), diagnosis(1)).added
    (kept,) = history.unit("S1").diagnoses()
    added = diagnosis(1)
    assert (kept.hours, kept.flight) == (10.5, Flight(10.5, 7, "left"))
    assert (kept.recording, kept.recording_hash) == ("1.csv", recording_hash(recording(1)))
    assert kept.explained is True
    np.testing.assert_array_equal(kept.vector, added.faults.vector)
    np.testing.assert_array_equal(kept.covariance, added.covariance)
    assert kept.coordinates == added.coordinates
    assert kept.version == added.version
    assert kept.verdicts == dict.fromkeys(NAMES, "degraded")
    assert kept.document == json.loads(added.to_json())
    assert history.unit("S1").actuator == made_up.THESIS


def test_the_eccentricity_is_stored_as_a_vector_with_its_covariance(history: History) -> None:
    fill(history, range(1, 2))
    (kept,) = history.unit("S1").diagnoses()
    np.testing.assert_allclose(kept.cartesian, made_up.cartesian(1))
    radius = np.hypot(*kept.cartesian[5:7])
    assert radius == pytest.approx(kept.faults.eccentricity)
    np.testing.assert_array_equal(kept.cartesian_covariance, diagnosis(1).covariance[:8, :8])


def test_the_shared_covariance_of_diagnoses_is_stored(history: History) -> None:
    tolerances = Tolerances(inertia=0.1)
    with_shared_error = replace(
        diagnosis(1),
        actuator=made_up.THESIS.model_copy(update={"tolerances": tolerances}),
        coordinates=(*diagnosis(1).coordinates[:9], "baseline inertia"),
    )
    history.add(entry(), recording(1), with_shared_error)
    history.add(entry(hours=20.0), recording(2), diagnosis(2))
    first, second = (kept.cartesian_shared_covariance for kept in history.unit("S1").diagnoses())
    np.testing.assert_array_equal(first, with_shared_error.shared_covariance)
    assert first.any()
    assert not second.any()


def test_a_component_that_is_not_estimated_has_its_prior_variance(history: History) -> None:
    full = diagnosis(1)
    estimated = [0, 1, 7, 8]  # friction, backlash, gain, load: an actuator without windings
    prior = 1 / 12**0.5
    components = {
        name: replace(estimate, standard_error=prior) if name.startswith(("short", "ecc")) else estimate
        for name, estimate in full.components.items()
    }
    reduced = replace(
        full,
        components=components,
        coordinates=tuple(full.coordinates[i] for i in estimated),
        covariance=full.covariance[np.ix_(estimated, estimated)],
    )
    history.add(entry(), recording(1), reduced)
    (kept,) = history.unit("S1").diagnoses()
    expected = np.zeros((8, 8))
    expected[np.ix_([0, 1, 7], [0, 1, 7])] = full.covariance[np.ix_([0, 1, 7], [0, 1, 7])]
    expected[range(2, 7), range(2, 7)] = 1 / 12
    np.testing.assert_allclose(kept.cartesian_covariance, expected)


def test_adding_a_recording_twice_changes_nothing(history: History) -> None:
    fill(history, range(1, 4))
    before = unit_blocks(history.unit("S1"))
    again = history.add(entry(hours=20.0), recording(2), diagnosis(2))
    assert not again.added
    assert not history.missing(entry(hours=20.0), recording(2), made_up.THESIS)
    assert unit_blocks(history.unit("S1")) == before


def test_the_hash_of_a_recording_depends_on_its_values_and_not_on_its_name() -> None:
    original = recording(3)
    renamed = Recording(original.channels, source="elsewhere.parquet")
    assert recording_hash(renamed) == recording_hash(original)
    changed = {**original.channels, "current_A": original["current_A"] + 1e-12}
    assert recording_hash(Recording(changed)) != recording_hash(original)
    assert recording_hash(Recording(original.channels, "instant")) != recording_hash(original)


def test_a_diagnosis_with_other_settings_replaces_the_previous_one(history: History) -> None:
    fill(history, range(1, 3))
    assert history.missing(entry(hours=10.0), recording(1), made_up.THESIS, seed=5)
    assert history.add(entry(hours=10.0), recording(1), diagnosis(1, explained=False, seed=5)).added
    first, second = history.unit("S1").diagnoses()
    assert (first.settings.seed, second.settings.seed) == (5, 0)
    (line,) = history.states()
    assert (line.recordings, line.explained, line.hours) == (2, 1, 20.0)
    assert line.document["recording"] == "2.csv"


def test_a_diagnosis_is_stored_under_the_given_description(history: History) -> None:
    ripple = (RippleHarmonic(order=12, cos=0.01),)  # a law that the diagnosis has estimated
    result = replace(diagnosis(1), actuator=made_up.THESIS.model_copy(update={"ripple": ripple}))
    assert history.kept(recording(1), made_up.THESIS) is None
    history.add(entry(), recording(1), result, made_up.THESIS)
    assert not history.missing(entry(), recording(1), made_up.THESIS)
    kept = history.kept(recording(1), made_up.THESIS)
    assert kept is not None
    np.testing.assert_array_equal(kept.vector, result.faults.vector)
    assert history.unit("S1").actuator == made_up.THESIS


def test_the_state_of_a_unit_has_the_last_diagnosis_of_its_last_flight(history: History) -> None:
    for number in (1, 2):
        history.add(entry(hours=10.0), recording(number), diagnosis(number))
    history.add(entry(hours=10.0), recording(1), diagnosis(1, seed=5))
    (state,) = history.states()
    assert (state.document["recording"], state.document["seed"]) == ("1.csv", 5)


def test_the_direction_of_an_eccentricity_is_not_listed_as_degraded(history: History) -> None:
    degraded = diagnosis(1)
    assert {estimate.verdict for estimate in degraded.components.values()} == {"degraded"}
    history.add(entry(), recording(1), degraded)
    with history.database.reading() as connection:
        (line,) = diagnosis_lines(connection)
    (state,) = history.states()
    assert line.degraded == degraded_in(state.document) == COMPONENTS


def test_a_unit_has_the_last_stated_cycles(history: History) -> None:
    for number, cycles in enumerate((None, 50, None)):
        flown = replace(entry(hours=10.0 * number), cycles=cycles)
        history.add(flown, recording(number), diagnosis(number))
        (state,) = history.states()
        assert state.cycles == unit_blocks(history.unit("S1"))["unit"]["cycles"] == (50 if number else None)
    assert state.hours == 20.0


def test_units_are_listed_by_part_number(history: History) -> None:
    fill(history, range(1, 3), "S2")
    fill(history, range(3, 4), "S1")
    other = made_up.THESIS.model_copy(update={"name": "other"})
    history.add(entry("X1", part="other"), recording(9), diagnosis(9, actuator=other))
    assert [unit.serial_number for unit in history.units()] == ["X1", "S1", "S2"]
    assert [unit.serial_number for unit in history.units("other")] == ["X1"]
    assert [line.serial_number for line in history.states(made_up.PART)] == ["S1", "S2"]


def test_a_position_is_valid_until_the_unit_is_removed(history: History) -> None:
    for number, (hours, position) in enumerate([(1, "left"), (2, None), (4, None), (5, "right"), (6, None)]):
        flown = Entry("S1", made_up.PART, hours, position=position)
        history.add(flown, recording(number), diagnosis(number))
    assert history.add_removal("S1", Removal(2.0, "scheduled"))
    positions = [flight.position for flight in history.unit("S1").flights()]
    assert positions == ["left", "left", None, "right", "right"]


def test_a_recording_completes_missing_data_of_its_flight(history: History) -> None:
    history.add(Entry("S1", made_up.PART, 1.0), recording(1), diagnosis(1))
    history.add(Entry("S1", made_up.PART, 1.0, 4, "left"), recording(2), diagnosis(2))
    history.add(Entry("S1", made_up.PART, 1.0), recording(3), diagnosis(3))
    assert history.unit("S1").flights() == (Flight(1.0, 4, "left"),)


# Removals, findings, lives


def test_a_finding_may_have_a_friction_below_that_of_a_new_unit(history: History) -> None:
    history.add(entry("S1", 10.0), recording(0), diagnosis(0))
    history.add_finding("S1", Finding(10.0, "friction", "degraded", -0.2))
    assert [finding.level for finding in history.unit("S1").findings()] == [-0.2]


def test_repeated_removals_and_findings_are_stored_once(history: History) -> None:
    fill(history, range(1, 3))
    removal = Removal(20.0, "failed", "jam")
    finding = Finding(20.0, "backlash", "failed", 0.7, replaced=True, note="nut worn")
    assert history.add_removal("S1", removal)
    assert not history.add_removal("S1", removal)
    assert history.add_finding("S1", finding)
    assert not history.add_finding("S1", finding)
    unit = history.unit("S1")
    assert unit.removals() == (removal,)
    assert unit.findings() == (finding,)
    assert unit.replacements() == (Replacement(20.0, "backlash"),)


def test_lives_end_with_a_failure_or_are_censored(history: History) -> None:
    fill(history, range(1, 6))
    history.add_removal("S1", Removal(20.0, "failed"))
    history.add_removal("S1", Removal(40.0, "failed"))
    history.add_finding("S1", Finding(40.0, "backlash", "degraded", replaced=True))
    unit = history.unit("S1")
    # There is no finding at 20 h; at 40 h the shop found no failure.
    assert unit.lives() == (Life(0.0, 20.0, True), Life(20.0, 40.0, False), Life(40.0, 50.0, False))
    assert unit.lives("backlash") == (Life(0.0, 40.0, False), Life(40.0, 50.0, False))
    assert unit.lives("friction") == (Life(0.0, 50.0, False),)
    assert all(life.censored != life.failed for life in unit.lives())


def test_a_components_life_ends_with_its_failure_or_the_exchange_of_the_unit(history: History) -> None:
    fill(history, range(1, 6))
    history.add_finding("S1", Finding(20.0, "friction", "failed"))
    history.add_finding("S1", Finding(30.0, "unit", "healthy", replaced=True))
    unit = history.unit("S1")
    # A component that failed and was not replaced has no new life.
    assert unit.lives("friction") == (Life(0.0, 20.0, True), Life(30.0, 50.0, False))
    assert unit.lives("gain") == (Life(0.0, 30.0, False), Life(30.0, 50.0, False))


# For other programs


def test_the_blocks_contain_each_key_of_a_diagnosis_once(history: History) -> None:
    fill(history, range(1, 2))
    (kept,) = history.unit("S1").diagnoses()
    blocks = diagnosis_blocks(kept)
    parts = [
        blocks[name] for name in ("data_manipulation", "state_detection", "health_assessment", "settings")
    ]
    keys = [key for part in parts for key in part]
    assert len(keys) == len(set(keys))
    assert set(keys) - {"recording_hash", "description"} == set(kept.document)
    assert {"explained", "moves"} < set(blocks["state_detection"])
    assert {"faults", "k", "covariance"} < set(blocks["health_assessment"])
    assert "notes" in blocks["data_manipulation"]
    assert set(METHOD) < set(blocks["settings"])


def test_the_latest_diagnoses_and_a_sample_of_the_earlier_ones_are_selected(history: History) -> None:
    fill(history, range(1, 11), "S1")
    unit = history.unit("S1")
    all_hours = [kept.hours for kept in unit.diagnoses()]
    assert [kept.hours for kept in unit.diagnoses(3)] == all_hours[-3:]
    # Every 4th of the 7 diagnoses before the latest three, at most two.
    assert [kept.hours for kept in unit.diagnoses(3, 2)] == [*all_hours[:7:4], *all_hours[-3:]]
    assert [kept.hours for kept in unit.diagnoses(3, 7)] == all_hours
    assert [kept.hours for kept in unit.diagnoses(0, 2)] == all_hours[::8]


def test_an_export_contains_all_units(history: History, tmp_path: Path) -> None:
    fill(history, range(1, 4), "S1")
    fill(history, range(4, 6), "S2")
    assert export(history, tmp_path / "all.json") == 2
    assert export(history, tmp_path / "all.csv") == 2
    assert export(history, tmp_path / "all.parquet") == 2
    units = json.loads((tmp_path / "all.json").read_text())["units"]
    assert units == [json.loads(json.dumps(unit_blocks(unit))) for unit in history.units()]
    table = pl.read_parquet(tmp_path / "all.parquet")
    assert table["serial_number"].to_list() == ["S1"] * 3 + ["S2"] * 2
    np.testing.assert_array_equal(table.select(NAMES).row(1), diagnosis(2).faults.vector)
    assert pl.read_csv(tmp_path / "all.csv").select("recording_hash").equals(table.select("recording_hash"))
    with pytest.raises(OutputError, match="exists already"):
        export(history, tmp_path / "all.csv")


# Withdrawals


def test_a_recording_entered_under_the_wrong_unit_can_be_moved(history: History) -> None:
    fill(history, range(1, 3), "S1")
    history.add(Entry("S2", made_up.PART, 30.0, 7, "left"), recording(3), diagnosis(3))
    before = unit_blocks(history.unit("S1"))
    withdrawal = history.withdraw("S2", Mistake("recording", 30.0, "it was of S1"))
    assert (withdrawal.kind, withdrawal.hours, withdrawal.subject, withdrawal.reason) == (
        "recording",
        30.0,
        "3.csv",
        "it was of S1",
    )
    assert [unit.serial_number for unit in history.units()] == ["S1"]
    assert unit_blocks(history.unit("S1")) == before
    # The withdrawal records all data of the entry.
    assert (withdrawal.entry["hash"], withdrawal.entry["cycles"], withdrawal.entry["position"]) == (
        recording_hash(recording(3)),
        7,
        "left",
    )
    (kept,) = withdrawal.entry["diagnoses"]
    assert kept["vector"] == diagnosis(3).faults.vector.tolist()
    assert kept["covariance"] == diagnosis(3).covariance.ravel().tolist()
    assert kept["document"]["k"] == diagnosis(3).to_dict()["k"]
    assert history.add(entry("S1", 30.0), recording(3), diagnosis(3)).added
    assert [kept_diagnosis.recording for kept_diagnosis in history.unit("S1").diagnoses()] == [
        "1.csv",
        "2.csv",
        "3.csv",
    ]
    # The withdrawal stays under its serial number, also if a unit with this number is added again.
    assert history.add(entry("S2", 5.0), recording(4), diagnosis(4)).added
    assert history.unit("S2").withdrawals() == (withdrawal,)
    assert history.unit("S1").withdrawals() == ()


def test_hours_with_many_digits_are_found_as_texts_show_them(history: History) -> None:
    for number in (1, 2):
        history.add(entry(hours=number * 1000 / 3), recording(number), diagnosis(number))
    with pytest.raises(HistoryError, match=r"the nearest are at 333\.333333 h"):
        history.withdraw("S1", Mistake("recording", 333.0, "too early"))
    assert history.withdraw("S1", Mistake("recording", 333.333333, "too early")).hours == 1000 / 3


def test_a_unit_withdrawn_while_a_program_reads_it_is_not_taken_for_another_unit(history: History) -> None:
    for number in (1, 2):
        history.add(entry(f"S{number}"), recording(number), diagnosis(number))
    withdrawn = history.unit("S2")
    history.withdraw("S2", Mistake("recording", 10.0, "of S3"))
    with pytest.raises(HistoryError, match="no unit 'S2'"):
        unit_blocks(withdrawn)
    history.add(entry("S3"), recording(2), diagnosis(2))  # SQLite assigns the id again
    for read in (
        lambda: unit_blocks(withdrawn),
        withdrawn.entries,
        withdrawn.flights,
        withdrawn.diagnoses,
        withdrawn.removals,
        withdrawn.findings,
        withdrawn.lives,
        withdrawn.description_notes,
        lambda: withdrawn.actuator,
    ):
        with pytest.raises(HistoryError, match="no unit 'S2'"):
            read()


def test_wrong_cycles_of_a_flight_are_corrected_as_the_refusal_states(history: History) -> None:
    """The flight of two recordings keeps the cycles of the first after it is withdrawn."""
    wrong, right, none = (replace(entry(), cycles=cycles) for cycles in (55, 50, None))
    history.add(wrong, recording(1), diagnosis(1))
    history.add(none, recording(2), diagnosis(2))
    history.withdraw("S1", Mistake("recording", 10.0, "wrong cycles", "1.csv"))
    with pytest.raises(HistoryError, match="withdraw all recordings of those hours"):
        history.add(right, recording(1), diagnosis(1))
    history.withdraw("S1", Mistake("recording", 10.0, "wrong cycles"))
    history.add(right, recording(1), diagnosis(1))
    history.add(none, recording(2), diagnosis(2))
    assert [flight.cycles for flight in history.unit("S1").flights()] == [50]


def test_a_recording_to_be_withdrawn_is_selected_by_its_file_name(history: History) -> None:
    for number, name in enumerate(("left/1.csv", "right/1.csv", "right/2.csv")):
        history.add(entry(), Recording(recording(number).channels, source=name), diagnosis(number))
    assert history.withdraw("S1", Mistake("recording", 10.0, "typo", "2.csv")).subject == "right/2.csv"
    with pytest.raises(HistoryError, match="name the entry with --which"):
        history.withdraw("S1", Mistake("recording", 10.0, "typo", "1.csv"))
    assert history.withdraw("S1", Mistake("recording", 10.0, "typo", "left/1.csv")).subject == "left/1.csv"


def test_withdrawn_entries_have_no_effect(history: History) -> None:
    fill(history, range(1, 3))
    history.add_removal("S1", Removal(20.0, "failed"))
    history.add_finding("S1", Finding(20.0, "friction", "failed", replaced=True))
    history.add_finding("S1", Finding(20.0, "backlash", "failed"))
    before = unit_blocks(history.unit("S1"))
    history.add(entry(hours=20.0), recording(7), diagnosis(7, explained=False))
    history.add(entry(hours=30.0, late=True), recording(8), diagnosis(8))
    history.add_removal("S1", Removal(30.0, "failed"))
    history.add_finding("S1", Finding(20.0, "gain", "failed", replaced=True))
    for mistake in (
        Mistake("finding", 20.0, "another unit's", "gain"),
        Mistake("removal", 30.0, "another unit's"),
        Mistake("recording", 20.0, "cut wrongly", recording_hash(recording(7))[:8]),
        Mistake("recording", 30.0, "cut wrongly", "8.csv"),
    ):
        history.withdraw("S1", mistake)
    after = unit_blocks(history.unit("S1"))
    assert [withdrawal["subject"] for withdrawal in after.pop("withdrawals")] == [
        "gain",
        "failed",
        "7.csv",
        "8.csv",
    ]
    assert before.pop("withdrawals") == []
    assert after == before
    assert history.states()[0].hours == 20.0


def test_a_withdrawal_makes_the_prognosis_out_of_date(history: History) -> None:
    fill(history, range(1, 3))
    history.add_removal("S1", Removal(20.0, "failed"))
    history.keep_prognosis("S1", KeptPrognosis.of(history.basis("S1"), {"hours": 20.0, "rul_hours": {}}))
    assert not unit_blocks(history.unit("S1"))["prognostic_assessment"]["out_of_date"]
    history.withdraw("S1", Mistake("removal", 20.0, "another unit's"))
    assert unit_blocks(history.unit("S1"))["prognostic_assessment"]["out_of_date"]


def test_curves_are_replaced_with_the_stored_prognosis(history: History) -> None:
    fill(history, range(1, 3))
    row, kept = history.unit("S1").row, KeptPrognosis.of(history.basis("S1"), {"hours": 20.0})
    for curves in ({"fan": [], "horizon": 500.0}, {"fan": [], "horizon": 800.0}, None):
        with history.writing() as connection:
            keep_prognosis(connection, row, kept, curves)
        with history.database.reading() as connection:
            assert read_curves(connection, row.id) == curves


def test_a_withdrawal_deletes_the_curves_of_the_prognosis(history: History) -> None:
    fill(history, range(1, 4))
    history.add_removal("S1", Removal(20.0, "failed"))
    history.add_finding("S1", Finding(20.0, "friction", "failed", replaced=True))
    row = history.unit("S1").row
    kept = KeptPrognosis.of(history.basis("S1"), {"hours": 30.0})
    for mistake in (
        Mistake("recording", 30.0, "another unit's"),
        Mistake("finding", 20.0, "another unit's"),
        Mistake("removal", 20.0, "another unit's"),
    ):
        with history.writing() as connection:
            keep_prognosis(connection, row, kept, {"fan": []})
        history.withdraw("S1", mistake)
        with history.database.reading() as connection:
            assert read_curves(connection, row.id) is None
    # The withdrawal of its last recording deletes a unit with its curves.
    history.withdraw("S1", Mistake("recording", 20.0, "another unit's"))
    with history.writing() as connection:
        keep_prognosis(connection, row, kept, {"fan": []})
    history.withdraw("S1", Mistake("recording", 10.0, "another unit's"))
    assert not history.units()
