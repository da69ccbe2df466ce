"""`emaphm history`: diagnoses of a unit's recordings are stored, and errors are reported in one line."""

import json
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from emaphm.actuator import NAMES, Actuator
from emaphm.cli import main
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.errors import MethodError
from emaphm.fleet import settings as settings_module
from emaphm.recording import Recording
from emaphm.recording.content import recording_hash

from .conftest import Emaphm, Refusal


@pytest.fixture(scope="module", autouse=True)
def _diagnosed_once() -> Iterator[None]:
    """Diagnose each recording only once: most tests check how and where a diagnosis is stored."""
    diagnoses: dict[tuple[str, str], Diagnosis] = {}

    def once(recording: Recording, actuator: Actuator, **settings: Any) -> Diagnosis:
        key = (recording_hash(recording), f"{recording.source}, {settings['seed']}")
        if key not in diagnoses:
            diagnoses[key] = diagnose(recording, actuator, **settings)
        return diagnoses[key]

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(settings_module, "diagnose", once)
        yield


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the recordings first.csv and second.csv of a wearing actuator."""
    from emaphm.actuator import Chirp, Faults
    from emaphm.recording import write_recording
    from emaphm.simulated_recording import simulate

    folder = tmp_path_factory.mktemp("recordings")
    for seed, (name, friction) in enumerate([("first", 0.2), ("second", 0.4)]):
        recording = simulate(
            Actuator.thesis(), Chirp(), faults=Faults(friction=friction), noise=0.05, seed=seed
        )
        # With fewer channels, a diagnosis takes half the time.
        reduced = Recording(
            {channel: recording[channel] for channel in ("time_s", "command_rad", "current_A")}
        )
        write_recording(reduced, folder / f"{name}.csv")
    return folder


@pytest.fixture(scope="module")
def first_flight(recordings: Path) -> Path:
    """Return a history of unit SN-7: first.csv at 100 h, 40 cycles."""
    path = recordings / "history.sqlite"
    unit = ("--unit", "SN-7", "--hours", "100", "--cycles", "40", "--position", "left aileron")
    assert main(["history", "add", str(recordings / "first.csv"), *unit, "--db", str(path)]) == 0
    return path


@pytest.fixture
def flown(desk: Path, first_flight: Path) -> Path:
    """Return the current folder with a copy of `first_flight` as the default history."""
    shutil.copy(first_flight, desk / "history.sqlite")
    return desk


def answer(emaphm: Emaphm, *arguments: str | Path) -> dict[str, Any]:
    code, out, err = emaphm("history", *arguments, "--json")
    assert (code, err) == (0, "")
    result = json.loads(out)
    assert isinstance(result, dict)
    return result


def test_the_first_recording_creates_the_history_and_the_unit(
    emaphm: Emaphm, desk: Path, recordings: Path
) -> None:
    code, out, err = emaphm("history", "add", recordings / "first.csv", "--unit", "SN-8", "--hours", "100")
    assert (code, err) == (0, "")
    assert "diagnosed and added: " in out
    assert "new unit SN-8 (thesis) at 100 h, in history.sqlite" in out
    assert (desk / "history.sqlite").is_file()


@pytest.mark.usefixtures("flown")
@pytest.mark.parametrize(
    ("unit", "similar"), [("sn 7", ["SN-7"]), ("SN7", ["SN-7"]), ("SN-17", []), ("SN-7", [])]
)
def test_a_new_unit_with_a_name_like_that_of_a_known_unit_has_a_note(
    emaphm: Emaphm, recordings: Path, unit: str, similar: list[str]
) -> None:
    added = ("add", recordings / "second.csv", "--unit", unit, "--hours", "120")
    assert answer(emaphm, *added)["similar_units"] == similar
    assert "Note" not in emaphm("history", *added).out  # the unit is known now


def test_an_error_states_which_recordings_of_the_flight_are_in_the_history(
    emaphm: Emaphm, flown: Path, recordings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any, **__: Any) -> Diagnosis:
        raise MethodError("is of another manoeuvre")

    monkeypatch.setattr(settings_module, "diagnose", refuse)
    first, second, again = recordings / "first.csv", recordings / "second.csv", flown / "again.csv"
    shutil.copy(second, again)
    flight = ("--unit", "SN-7", "--hours", "100")
    code, out, err = emaphm("history", "add", first, second, again, *flight)
    assert (code, out) == (2, "")
    assert err == (
        f"emaphm: is of another manoeuvre; in the history: {first}; not diagnosed: again.csv\n"
    ).replace("again.csv", str(again))


@pytest.mark.usefixtures("flown")
def test_the_note_on_a_similar_name_states_the_remedy(emaphm: Emaphm, recordings: Path) -> None:
    answer_with_note = emaphm("history", "add", recordings / "second.csv", "--unit", "SN_7", "--hours", "120")
    assert answer_with_note.code == 0
    assert "Note: the history has a unit SN-7 too" in answer_with_note.out
    assert "history withdraw" in answer_with_note.out


def test_adding_diagnoses_only_new_recordings(emaphm: Emaphm, flown: Path, recordings: Path) -> None:
    history_before = answer(emaphm, "show", "--unit", "SN-7")
    second_addition = answer(emaphm, "add", recordings / "first.csv", "--unit", "SN-7", "--hours", "100")
    assert [item["added"] for item in second_addition["recordings"]] == [False]
    assert second_addition["cycles"] == 40  # those of the flight, although not given again
    assert answer(emaphm, "show", "--unit", "SN-7") == history_before
    third_addition = answer(
        emaphm,
        "add",
        recordings / "second.csv",
        recordings / "second.csv",
        "--unit",
        "SN-7",
        "--hours",
        "150",
    )
    assert [item["added"] for item in third_addition["recordings"]] == [True, False]
    first, second = third_addition["recordings"]
    assert second == first | {"added": False}
    assert (third_addition["new_unit"], third_addition["unit"], third_addition["part_number"]) == (
        False,
        "SN-7",
        "thesis",
    )
    diagnoses = answer(emaphm, "show", "--unit", "SN-7")["diagnoses"]
    assert [item["hours"] for item in diagnoses] == [100.0, 150.0]
    friction = [item["health_assessment"]["faults"]["friction"] for item in diagnoses]
    for item, truth in zip(friction, (0.2, 0.4), strict=True):
        assert item["verdict"] == "degraded"
        # As in the tests of diagnoses: within four standard errors.
        assert item["value"] == pytest.approx(truth, abs=4 * item["standard_error"])
    assert flown.is_dir()


def test_the_stored_diagnosis_equals_that_printed_by_diagnose(
    emaphm: Emaphm, flown: Path, recordings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert flown.is_dir()
    monkeypatch.setattr(settings_module, "diagnose", diagnose)
    printed = json.loads(emaphm("diagnose", recordings / "first.csv", "--json").out)
    (stored,) = answer(emaphm, "show", "--unit", "SN-7")["diagnoses"]
    blocks = ("data_manipulation", "state_detection", "health_assessment", "settings")
    joined = {key: value for block in blocks for key, value in stored[block].items()}
    assert joined["recording_hash"]
    for key in set(printed) - {"seconds"}:
        assert joined[key] == printed[key], key


def test_json_has_the_blocks_of_iso_13374(emaphm: Emaphm, flown: Path) -> None:
    assert flown.is_dir()
    unit = answer(emaphm, "show", "--unit", "SN-7")
    (stored,) = unit["diagnoses"]
    assert {"data_manipulation", "state_detection", "health_assessment"} < set(stored)
    assert {"prognostic_assessment", "advisory_generation"} < set(unit)
    assert unit["unit"] == {
        "serial_number": "SN-7",
        "part_number": "thesis",
        "position": "left aileron",
        "hours": 100.0,
        "cycles": 40,
    }
    assert set(stored["health_assessment"]["faults"]) == set(NAMES)


def test_the_stresses_of_a_unit_are_stored_with_the_flight(
    emaphm: Emaphm, flown: Path, recordings: Path
) -> None:
    assert flown.is_dir()
    stress = ("--load", "0.4", "--temperature", "290")
    flight = ("--unit", "SN-7", "--hours", "150", "--cycles", "80")
    answer(emaphm, "add", recordings / "second.csv", *flight, *stress)
    first, second = answer(emaphm, "show", "--unit", "SN-7")["flights"]
    assert (first["load"], first["temperature"]) == (None, None)
    assert (second["load"], second["temperature"]) == (0.4, 290.0)
    prognosis = json.loads(emaphm("prognose", "--unit", "SN-7", "--load", "0.8", "--json").out)
    assert prognosis["stress"] == {
        "reference": {"load": 0.4, "temperature_K": 290.0, "cycles_per_hour": pytest.approx(0.6)},
        "ahead": {"load": 0.8, "temperature_K": None, "cycles_per_hour": None},
    }


def test_removals_and_findings(emaphm: Emaphm, flown: Path) -> None:
    assert flown.is_dir()
    removal = ("removal", "--unit", "SN-7", "--hours", "120", "--reason", "suspected", "--note", "slow")
    finding = ("finding", "--unit", "SN-7", "--hours", "120", "--component", "friction")
    finding_options = ("--condition", "failed", "--level", "0.31", "--replaced")
    assert [answer(emaphm, *removal)["added"] for _ in range(2)] == [True, False]
    assert [answer(emaphm, *finding, *finding_options)["added"] for _ in range(2)] == [True, False]
    unit = answer(emaphm, "show", "--unit", "SN-7")
    assert unit["replacements"] == [{"hours": 120.0, "component": "friction"}]
    (life,) = unit["lives"]["unit"]
    assert (life["end_hours"], life["failed"], life["censored"]) == (120.0, True, False)
    text = emaphm("history", "show", "--unit", "SN-7").out
    lines = [line.strip() for line in text.splitlines()]
    assert lines.index("removed at 120 h: suspected (slow)") > 3  # after the flight at 100 h
    assert "found at 120 h: friction failed, level 0.31, replaced" in lines
    assert "position not known" in text


@pytest.mark.parametrize(
    ("removed", "found", "words"),
    [
        ("120", "121", "no removal at 121 h, the nearest is at 120 h"),
        (None, "40000", "last recording of SN-7 is of 100 h, and it has no removal"),
        ("120", "120", None),
        (None, "90", None),
    ],
)
def test_a_finding_at_hours_that_differ_from_the_units_has_a_note(
    emaphm: Emaphm, flown: Path, removed: str | None, found: str, words: str | None
) -> None:
    assert flown.is_dir()
    if removed is not None:
        answer(emaphm, "removal", "--unit", "SN-7", "--hours", removed)
    finding = (
        "finding",
        "--unit",
        "SN-7",
        "--hours",
        found,
        "--component",
        "friction",
        "--condition",
        "failed",
    )
    note = answer(emaphm, *finding)["doubt"]
    assert note is None if words is None else words in note
    assert ("Note: " in emaphm("history", *finding).out) == (words is not None)


@pytest.mark.parametrize(
    ("hours", "words"),
    [("60", "after this removal: 1, up to 100 h; the unit counts as in service"), ("120", None)],
)
def test_a_removal_before_the_last_recording_has_a_note(
    emaphm: Emaphm, flown: Path, hours: str, words: str | None
) -> None:
    assert flown.is_dir()
    note = answer(emaphm, "removal", "--unit", "SN-7", "--hours", hours, "--reason", "failed")["doubt"]
    assert note is None if words is None else words in note


def test_a_wrong_entry_can_be_withdrawn(emaphm: Emaphm, flown: Path) -> None:
    assert flown.is_dir()
    wrong = ("--unit", "SN-7", "--hours", "120")
    answer(emaphm, "removal", *wrong, "--reason", "failed")
    refused = emaphm("history", "removal", *wrong, "--reason", "scheduled").err
    assert "withdraw a wrong entry with 'emaphm history withdraw'" in refused
    withdrawal = answer(emaphm, "withdraw", "removal", *wrong, "--reason", "of SN-8")
    assert (withdrawal["kind"], withdrawal["subject"], withdrawal["unit_left"]) == ("removal", "failed", True)
    unit = answer(emaphm, "show", "--unit", "SN-7")
    assert unit["removals"] == []
    assert unit["withdrawals"][0]["reason"] == "of SN-8"
    assert "removal 'failed' at 120 h (of SN-8)" in emaphm("history", "show", "--unit", "SN-7").out
    only = ("withdraw", "recording", "--unit", "SN-7", "--hours", "100", "--reason", "another actuator")
    text = emaphm("history", *only).out
    assert "first.csv' of SN-7 at 100 h is withdrawn; it was its only recording" in text
    assert answer(emaphm, "list")["units"] == []


def test_list_and_export(emaphm: Emaphm, flown: Path) -> None:
    (line,) = answer(emaphm, "list")["units"]
    assert (line["serial_number"], line["hours"], line["recordings"], line["explained"]) == (
        "SN-7",
        100.0,
        1,
        1,
    )
    assert line["last"]["degraded"] == ["friction"]
    text = emaphm("history", "list").out
    assert "SN-7" in text
    assert "friction" in text
    assert answer(emaphm, "list", "--part", "thesis")["units"] == [line]
    assert answer(emaphm, "export", "-o", "out.csv")["units"] == 1
    assert emaphm("history", "export", "-o", "again.csv").out == "1 unit written to again.csv\n"
    table = pl.read_csv(flown / "out.csv")
    assert table.select("serial_number", "hours", "friction_verdict").row(0) == ("SN-7", 100.0, "degraded")


def test_a_unit_with_inconclusive_verdicts_is_not_called_healthy(emaphm: Emaphm, flown: Path) -> None:
    with closing(sqlite3.connect(flown / "history.sqlite")) as database:
        for verdict in ("degraded", "healthy"):
            conclusive, inconclusive = f'"verdict": "{verdict}"', '"verdict": "cannot tell"'
            database.execute(
                "UPDATE diagnoses SET document = replace(document, ?, ?)", (conclusive, inconclusive)
            )
        database.commit()
    (line,) = answer(emaphm, "list")["units"]
    assert (line["last"]["explained"], line["last"]["health"]) == (True, "cannot tell")
    assert emaphm("history", "list").out.rstrip().endswith("cannot tell")
    (row,) = (text for text in emaphm("history", "show", "--unit", "SN-7").out.splitlines() if "100 " in text)
    assert row.endswith("cannot tell")


def test_the_database_may_be_named_once_in_the_environment(
    emaphm: Emaphm, flown: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (flown / "history.sqlite").rename(flown / "fleet.sqlite")
    monkeypatch.setenv("EMAPHM_DB", "fleet.sqlite")
    assert len(answer(emaphm, "list")["units"]) == 1


REFUSALS = {
    ("show", "--unit", "sn-8"): "no unit 'sn-8' in the history (did you mean 'SN-7'?)",
    ("removal", "--unit", "SN-8", "--hours", "3"): "did you mean 'SN-7'",
    ("add", "second.csv", "--unit", "SN-7", "--hours", "90"): "would be going backwards",
    ("add", "second.csv", "--unit", "SN-7", "--hours", "-1"): "hours -1",
    ("removal", "--unit", "SN-7", "--hours", "1e100"): "from 0 to 1,000,000",
    ("add", "second.csv", "--unit", "SN-7", "--hours", "200", "--cycles", "39"): "40 cycles at 100 h",
    ("add", "second.csv", "--unit", "SN-7", "--hours", "200", "--part", "P2"): "part number 'thesis'",
    ("add", "second.csv", "--unit", "SN-7", "--hours", "200", "--actuator", "pmsm"): "part number 'thesis'",
    ("add", "first.csv", "--unit", "SN-9", "--hours", "100"): "of unit 'SN-7'",
    ("add", "absent.csv", "--unit", "SN-9", "--hours", "100"): "absent.csv: no such file",
    ("add", "first.csv", "--unit", "SN-7", "--hours", "100", "--db", "no/h.sqlite"): "no folder 'no'",
    ("finding", "--unit", "SN-7", "--hours", "1", "--component", "frictoin", "--condition", "failed"): (
        "did you mean 'friction'"
    ),
    ("removal", "--unit", "SN-7", "--hours", "1", "--reason", "unknown"): "unknown reason",
    ("withdraw", "removal", "--unit", "SN-7", "--hours", "1", "--reason", "typo"): "no removal there",
    (
        "withdraw",
        "flight",
        "--unit",
        "SN-7",
        "--hours",
        "1",
        "--reason",
        "typo",
    ): "cannot withdraw a 'flight'",
    ("list", "--db", "absent.sqlite"): "no such history",
    ("list", "--db", "first.csv"): "first.csv: the database cannot be used (file is not a database)",
    ("list", "--db", "postgresql://me:secret@127.0.0.1:1/fleet"): "postgresql://me:***@127.0.0.1:1/fleet",
    ("export", "-o", "out.xml"): "unknown file ending '.xml'",
    ("export", "-o", "out.csv", "--part", "thesos"): "no units of the part number 'thesos' (did you mean",
    ("list", "--part", "thesos"): "no units of the part number 'thesos' (did you mean 'thesis'?)",
}


@pytest.mark.parametrize("arguments", REFUSALS, ids=" ".join)
def test_errors_are_reported_in_one_line(
    flown: Path, recordings: Path, refused: Refusal, arguments: tuple[str, ...]
) -> None:
    for name in ("first.csv", "second.csv"):
        (flown / name).symlink_to(recordings / name)
    message = refused("history", *arguments)
    assert REFUSALS[arguments] in message
    assert "secret" not in message
