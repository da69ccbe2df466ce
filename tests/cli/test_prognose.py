"""`emaphm prognose` and `emaphm limits`: results, and refusals in one line."""

import errno
import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from emaphm.actuator import COMPONENTS, NAMES, Actuator, Faults
from emaphm.actuator.toml import write_toml
from emaphm.errors import HistoryUnavailableError
from emaphm.history import Finding, History, Mistake, Removal
from emaphm.history.views import read_curves
from emaphm.prognosis import Evidence, Prognosis
from emaphm.prognosis.from_fleet import record
from emaphm.prognosis.keeping import Curves
from history import made_up

from .conftest import Emaphm, Refusal

pytestmark = pytest.mark.usefixtures("few_steps")

LIMITED = 'component = "friction"\nat_most = 0.6\n'


def wearing(history: History, unit: str, hours: list[float], rate: float, first: int) -> None:
    """Add a diagnosis at each of the hours for a unit with linearly rising friction, otherwise healthy."""
    for i, at in enumerate(hours):
        number = first + i
        level = Faults(friction=rate * at).vector
        diagnosis = made_up.diagnosis(number)
        components = {
            name: replace(component, value=float(value))
            for (name, component), value in zip(diagnosis.components.items(), level, strict=True)
        }
        covariance = 1e-4 * np.eye(len(diagnosis.coordinates))
        diagnosis = replace(diagnosis, components=components, covariance=covariance)
        history.add(made_up.entry(unit, at), made_up.recording(number), diagnosis)


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a history of three units; tests must not write to it."""
    file = tmp_path_factory.mktemp("flown") / "history.sqlite"
    with History.open(file, create=True) as history:
        wearing(history, "SN-1", [100.0 * i for i in range(1, 7)], 5e-4, 0)
        wearing(history, "SN-2", [50.0 * i for i in range(1, 5)], 5e-4, 100)
        wearing(history, "SN-3", [50.0], 5e-4, 200)
    return file


@pytest.fixture
def fleet(desk: Path, flown: Path) -> Path:
    """Return the current folder with a copy of that as the default history, and `required.toml`."""
    (desk / "history.sqlite").write_bytes(flown.read_bytes())
    text = write_toml(Actuator.thesis()) + f"\n[[requirements]]\n{LIMITED}"
    (desk / "required.toml").write_text(text, encoding="utf-8")
    return desk


def json_answer(emaphm: Emaphm, *arguments: str | Path) -> dict[str, Any]:
    code, out, err = emaphm(*arguments, "--json")
    assert (code, err) == (0, "")
    result = json.loads(out)
    assert isinstance(result, dict)
    return result


def test_a_unit_that_wears_is_predicted(emaphm: Emaphm, fleet: Path) -> None:
    assert fleet.is_dir()
    prognosis = json_answer(
        emaphm, "prognose", "--unit", "SN-1", "--actuator", "required.toml", "--horizon", "300"
    )
    # Friction 5e-4 an hour, limit 0.6, 600 h flown.
    assert prognosis["rul_hours"]["median"] == pytest.approx(600.0, rel=0.15)
    low, high = prognosis["rul_hours"]["interval90"]
    assert low < 600 < high
    assert (prognosis["component"], prognosis["requirement"]) == ("friction", "friction at most 0.6")
    assert prognosis["horizon_hours"] == 300.0
    assert 0 <= prognosis["probability_of_failure"] <= 1
    assert prognosis["prior"]["fleet_units"] == 1  # SN-2; SN-3 has only one diagnosis
    assert prognosis["advice"]["action"] in {"fly on", "inspect by", "replace before"}
    text = emaphm("prognose", "--unit", "SN-1", "--actuator", "required.toml").out
    assert "remaining useful life:" in text
    assert "advice:" in text


def test_failed_units_correct_the_prognosis_of_one_unit_and_of_all(
    emaphm: Emaphm, fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record, "PATHS", replace(record.PATHS, paths=100, steps=30))
    chosen = ("--actuator", "required.toml")
    life_before = json_answer(emaphm, "prognose", "--unit", "SN-1", *chosen)["rul_hours"]
    with History.open(fleet / "history.sqlite") as history:
        for i, rate in enumerate((8e-4, 1e-3, 1.1e-3, 1.2e-3)):
            wearing(history, f"SN-{10 + i}", [100.0, 250.0, 400.0], rate, 300 + 10 * i)
    of_units = json_answer(emaphm, "prognose", "--unit", "SN-1", *chosen)["rul_hours"]
    with History.open(fleet / "history.sqlite") as history:
        for i in range(4):
            history.add_removal(f"SN-{10 + i}", Removal(450.0 + i, "failed"))
        assert Evidence.of(history.unit("SN-10")).failures == (450.0,)
        assert Evidence.of(history.unit("SN-1")).failures == ()
    alone = json_answer(emaphm, "prognose", "--unit", "SN-1", *chosen)
    assert life_before != of_units != alone["rul_hours"]
    units = json_answer(emaphm, "prognose", "--all", *chosen, "--workers", "1")["units"]
    assert next(unit for unit in units if unit["unit"] == "SN-1")["rul_hours"] == alone["rul_hours"]


def test_a_failure_counts_although_the_unit_was_repaired_and_flies_again(fleet: Path) -> None:
    with History.open(fleet / "history.sqlite") as history:
        history.add_removal("SN-1", Removal(610.0, "failed"))
        history.add_finding("SN-1", Finding(610.0, "friction", "failed", replaced=True))
        wearing(history, "SN-1", [700.0, 800.0], 5e-4, 300)
        evidence = Evidence.of(history.unit("SN-1"))
    assert evidence.failures == (610.0,)
    assert evidence.failed_lives == ((-math.inf, 610.0),)
    assert evidence.lives(0) == ((0.0, 610.0), (610.0, math.inf))


@pytest.mark.usefixtures("undrawn_prognosis")
def test_a_failed_unit_has_no_remaining_life_until_it_is_repaired_or_flies(
    emaphm: Emaphm, fleet: Path
) -> None:
    chosen = ("--actuator", "required.toml", "--no-fleet")
    with History.open(fleet / "history.sqlite") as history:
        history.add_removal("SN-1", Removal(610.0, "failed"))
    prognosis = json_answer(emaphm, "prognose", "--unit", "SN-1", *chosen, "--keep")
    assert (prognosis["failed_at_hours"], prognosis["hours"]) == (610.0, 610.0)
    assert prognosis["rul_hours"] == {"median": 0.0, "interval90": [0.0, 0.0]}
    assert prognosis["probability_of_failure"] == 1.0
    assert (prognosis["advice"]["action"], prognosis["advice"]["in_hours"]) == ("replace before", 0.0)
    assert prognosis["notes"][0].startswith("the unit failed at 610 h")
    # No finding names the failed component: the cause is from the forecast, and the message states this.
    assert (prognosis["component"], prognosis["requirement"]) == (None, None)
    cause = "states the cause; the most likely component according to the diagnoses: friction"
    assert cause in prognosis["notes"][0]
    text = emaphm("prognose", "--unit", "SN-1", *chosen, "--report", "failed.html").out
    assert "remaining useful life: none, failed at 610 h, cause not found\n" in text
    assert "none, failed at 610 h" in (fleet / "failed.html").read_text(encoding="utf-8")
    assert "no remaining useful life, failed at 610 h" in emaphm("history", "show", "--unit", "SN-1").out
    (line,) = (row for row in emaphm("prognose", "--all", *chosen).out.splitlines() if "SN-1" in row)
    assert line.endswith("failed at 610 h")
    assert "not found" in line


def test_a_finding_names_the_failed_component_and_a_repair_ends_the_failure(
    emaphm: Emaphm, fleet: Path
) -> None:
    chosen = ("--unit", "SN-1", "--actuator", "required.toml", "--no-fleet")
    with History.open(fleet / "history.sqlite") as history:
        history.add_removal("SN-1", Removal(610.0, "suspected"))
        assert json_answer(emaphm, "prognose", *chosen)["failed_at_hours"] is None
        history.add_finding("SN-1", Finding(610.0, "backlash", "failed"))
        prognosis = json_answer(emaphm, "prognose", *chosen)
        assert (prognosis["failed_at_hours"], prognosis["component"]) == (610.0, "backlash")
        # Only the friction has a limit.
        assert prognosis["requirement"] is None
        assert "none, failed at 610 h, by backlash\n" in emaphm("prognose", *chosen).out
        history.add_finding("SN-1", Finding(610.0, "gain", "healthy", replaced=True))
        repaired = json_answer(emaphm, "prognose", *chosen)
        assert repaired["failed_at_hours"] is None
        assert repaired["notes"][0].startswith("backlash found failed at 610 h, and no replacement")
        assert repaired["rul_hours"]["median"] > 0
        history.add_removal("SN-2", Removal(210.0, "failed"))
        wearing(history, "SN-2", [300.0], 5e-4, 400)
    assert json_answer(emaphm, "prognose", "--unit", "SN-2", *chosen[2:])["failed_at_hours"] is None


def curves_of(history: History, unit: str) -> dict[str, Any]:
    """Return the curves of the stored prognosis of a unit."""
    with history.database.reading() as connection:
        curves = read_curves(connection, history.unit(unit).row.id)
    assert curves is not None
    return curves


def test_the_prognosis_fills_the_last_blocks_of_iso_13374(emaphm: Emaphm, fleet: Path) -> None:
    assert fleet.is_dir()
    prognosis = json_answer(emaphm, "prognose", "--unit", "SN-1")
    plain = json_answer(emaphm, "history", "show", "--unit", "SN-1")
    assert (plain["prognostic_assessment"], plain["advisory_generation"]) == (None, None)
    assert json_answer(emaphm, "prognose", "--unit", "SN-1", "--keep") == prognosis
    with History.open(fleet / "history.sqlite") as history:
        curves = curves_of(history, "SN-1")
    assert (curves["now"], curves["horizon"]) == (prognosis["hours"], prognosis["horizon_hours"])
    unit = json_answer(emaphm, "history", "show", "--unit", "SN-1")
    assert unit["advisory_generation"] == prognosis.pop("advice")
    assert prognosis.items() < unit["prognostic_assessment"].items()
    assert unit["prognostic_assessment"]["out_of_date"] is False
    with History.open(fleet / "history.sqlite") as history:
        wearing(history, "SN-1", [700.0], 5e-4, 300)
    assert json_answer(emaphm, "history", "show", "--unit", "SN-1")["prognostic_assessment"]["out_of_date"]
    assert ", out of date: remaining useful life" in emaphm("history", "show", "--unit", "SN-1").out


def test_results_of_all_units_equal_those_of_single_units(emaphm: Emaphm, fleet: Path) -> None:
    assert fleet.is_dir()
    chosen = ("--actuator", "required.toml", "--horizon", "200", "--seed", "3")
    prognoses = json_answer(emaphm, "prognose", "--all", *chosen, "--workers", "1", "--keep")
    alone = [json_answer(emaphm, "prognose", "--unit", name, *chosen) for name in ("SN-1", "SN-2", "SN-3")]
    assert prognoses["units"] == alone
    assert prognoses["failed"] == []
    with History.open(fleet / "history.sqlite") as history:
        assert set(history.prognoses()) == {"SN-1", "SN-2", "SN-3"}
        assert all(
            curves_of(history, unit_name)["horizon"] == 200.0 for unit_name in ("SN-1", "SN-2", "SN-3")
        )
    text = emaphm(
        "prognose", "--all", *chosen, "--workers", "1", "--part", prognoses["units"][0]["part_number"]
    ).out
    assert all(name in text for name in ("SN-1", "SN-2", "SN-3"))


def test_the_table_of_all_units_marks_units_with_notes(emaphm: Emaphm, fleet: Path) -> None:
    with History.open(fleet / "history.sqlite") as history:
        unexplained = made_up.diagnosis(900, explained=False)
        history.add(made_up.entry("SN-1", 650.0), made_up.recording(900), unexplained)
    chosen = ("prognose", "--all", "--no-fleet", "--actuator", "required.toml", "--workers", "1")
    lines = emaphm(*chosen).out.splitlines()
    assert "newest recording not explained, and not used in the prognosis: SN-1" in lines
    assert (
        "remaining useful life mostly from the prior, with explained diagnoses of fewer than 3 flights: SN-3"
        in lines
    )
    noted = json_answer(emaphm, *chosen)["units"]
    count = sum(bool(unit["notes"]) for unit in noted)
    assert lines[-1].startswith(
        f"notes on {count} of 3 units; for the notes of a unit: emaphm prognose --unit UNIT"
    )


def test_requirements_of_another_actuator_are_refused(fleet: Path, emaphm: Emaphm, refused: Refusal) -> None:
    text = (fleet / "required.toml").read_text(encoding="utf-8")
    own = made_up.PART
    (fleet / "renamed.toml").write_text(text.replace(f'name = "{own}"', 'name = "other"'), encoding="utf-8")
    expected = f"unit 'SN-1' has the part number '{own}', the description is of 'other'"
    for units in (("--unit", "SN-1"), ("--all",)):
        message = refused("prognose", *units, "--actuator", "renamed.toml")
        assert expected in message
        assert f'state name = "{own}" in it' in message
    # The part number given with --part differs from that of the description.
    with History.open(fleet / "history.sqlite") as history:
        entry = replace(made_up.entry("SN-9", 50.0), part_number="P-9")
        history.add(entry, made_up.recording(900), made_up.diagnosis(900))
    for described in ("required.toml", "named.toml"):
        (fleet / "named.toml").write_text(text.replace(f'name = "{own}"', 'name = "P-9"'), encoding="utf-8")
        json_answer(emaphm, "prognose", "--unit", "SN-9", "--no-fleet", "--actuator", described)
    assert "unit 'SN-1'" in refused("prognose", "--all", "--actuator", "named.toml")
    json_answer(emaphm, "prognose", "--all", "--part", "P-9", "--no-fleet", "--actuator", "named.toml")


def test_the_fleet_prior_can_be_left_out(emaphm: Emaphm, fleet: Path) -> None:
    assert fleet.is_dir()
    prognosis = json_answer(emaphm, "prognose", "--unit", "SN-3", "--no-fleet", "--actuator", "required.toml")
    assert prognosis["prior"] == {"fleet_units": 0, "fleet_share": 0.0}
    assert any("3 are needed to estimate a rate" in note for note in prognosis["notes"])


def test_a_replacement_is_taken_from_the_history(emaphm: Emaphm, fleet: Path) -> None:
    prognosis_before = json_answer(
        emaphm, "prognose", "--unit", "SN-1", "--actuator", "required.toml", "--no-fleet"
    )
    with History.open(fleet / "history.sqlite") as history:
        history.add_finding("SN-1", Finding(600.0, "friction", "failed", 0.3, replaced=True))
    prognosis_after = json_answer(
        emaphm, "prognose", "--unit", "SN-1", "--actuator", "required.toml", "--no-fleet"
    )
    assert prognosis_before["levels"]["friction"]["median"] > 0.25
    assert prognosis_after["levels"]["friction"]["median"] < 0.1


def test_a_report_and_a_figure_are_written(emaphm: Emaphm, fleet: Path) -> None:
    arguments = ("prognose", "--unit", "SN-2", "--no-fleet", "--report", "out.html", "--figure", "out.svg")
    outputs = [fleet / "out.html", fleet / "out.svg"]
    for path in outputs:
        path.write_text("three weeks of work", encoding="utf-8")
    assert emaphm(*arguments).code == 2
    assert [path.read_text(encoding="utf-8") for path in outputs] == ["three weeks of work"] * 2
    assert emaphm(*arguments, "--force").code == 0
    page = (fleet / "out.html").read_text(encoding="utf-8")
    assert "SN-2 at 200 h" in page
    assert page.count("data:image/svg+xml") == 3
    levels = page[page.index("most likely law") :]
    assert all(f">{name}<" in levels for name in COMPONENTS)
    assert (fleet / "out.svg").stat().st_size > 1000


@pytest.mark.usefixtures("fleet")
def test_a_full_disk_costs_the_figure_but_not_the_answer(
    emaphm: Emaphm, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.figure import Figure

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", full)
    code, out, err = emaphm("prognose", "--unit", "SN-2", "--no-fleet", "--json", "--figure", "out.svg")
    assert code == 2
    assert "No space left" in err
    assert json.loads(out)["unit"] == "SN-2"


def test_given_costs_decide_the_advice(emaphm: Emaphm, fleet: Path) -> None:
    assert fleet.is_dir()
    costs = ("--failure-cost", "50", "--replacement-cost", "1")
    prognosis = json_answer(
        emaphm, "prognose", "--unit", "SN-1", "--actuator", "required.toml", *costs, "--horizon", "2000"
    )
    assert "cheaper" in prognosis["advice"]["reason"]


def test_limits_are_printed(emaphm: Emaphm, fleet: Path) -> None:
    assert fleet.is_dir()
    answer = json_answer(emaphm, "limits", "--actuator", "required.toml", "--fault", "backlash=0.2")
    (requirement,) = answer["requirements"]
    assert requirement["fails_at"]["friction"] == {"rising": pytest.approx(0.6), "falling": None}
    assert set(requirement["fails_at"]) == set(NAMES) - {"eccentricity_phase"}
    assert (requirement["violated"], requirement["can_fail"]) == (False, True)
    assert answer["k"][1] == 0.2
    text = emaphm("limits", "--actuator", "required.toml", "--fault", "friction=0.7").out
    assert "violated already: friction at most 0.6" in text
    (row,) = (line for line in text.splitlines() if line.startswith("friction at most 0.6"))
    assert row.split() == [
        "friction",
        "at",
        "most",
        "0.6",
        "0.7",
    ]  # and no "–": a friction of 0.6 violates it
    assert "states no [[requirements]]" in emaphm("limits").out


REFUSALS = {
    ("prognose", "--unit", "SN-9"): "no unit 'SN-9' in the history (did you mean 'SN-",
    ("prognose", "--unit", "SN-1", "--horizon", "0"): "a horizon of 0 h",
    ("prognose", "--unit", "SN-1", "--horizon", "nan"): "a horizon of nan h",
    ("prognose", "--unit", "SN-1", "--risk", "1.5"): "a risk of 1.5 is not a probability",
    ("prognose", "--unit", "SN-1", "--failure-cost", "5"): "give --failure-cost and --replacement-cost",
    (
        "prognose",
        "--unit",
        "SN-1",
        "--failure-cost",
        "-5",
        "--replacement-cost",
        "1",
    ): "the cost of a failure",
    (
        "prognose",
        "--unit",
        "SN-1",
        "--failure-cost",
        "1",
        "--replacement-cost",
        "2",
    ): "costs 1, not more than",
    ("prognose", "--unit", "SN-1", "--seed", "-1"): "--seed -1",
    ("prognose", "--unit", "SN-1", "--load", "-1"): "a stress of load -1",
    ("prognose", "--unit", "SN-1", "--temperature", "-3"): "a temperature of -3 K",
    ("prognose", "--unit", "SN-1", "--all"): "give either --unit, or --all",
    ("prognose",): "give either --unit, or --all",
    ("prognose", "--unit", "SN-1", "--part", "thesis"): "leave it out with --unit",
    ("prognose", "--unit", "SN-1", "--workers", "2"): "--workers and --scheduler are for --all",
    ("prognose", "--all", "--report", "out.html"): "a figure or a report is of one unit",
    (
        "prognose",
        "--all",
        "--part",
        "thesos",
    ): "no units of the part number 'thesos' (did you",
    ("prognose", "--unit", "SN-1", "--report", "out.pdf"): "unknown file ending '.pdf'",
    ("prognose", "--unit", "SN-1", "--db", "absent.sqlite"): "no such history",
    ("prognose", "--unit", "SN-1", "--db", "postgresql://me:secret@127.0.0.1:1/f"): "postgresql://me:***@",
    ("prognose", "--unit", "SN-1", "--actuator", "absent.toml"): "absent.toml: no such actuator file",
    ("limits", "--actuator", "wrong.toml"): "did you mean 'at_most'",
    ("limits", "--fault", "frictoin=0.2"): "did you mean 'friction'",
    ("limits", "--fault", "friction=2"): "lies outside [-1, 1]",
}


@pytest.mark.parametrize("arguments", REFUSALS, ids=" ".join)
def test_errors_are_reported_in_one_line(fleet: Path, refused: Refusal, arguments: tuple[str, ...]) -> None:
    text = (fleet / "required.toml").read_text(encoding="utf-8")
    (fleet / "wrong.toml").write_text(text.replace("at_most", "atmost"), encoding="utf-8")
    message = refused(*arguments)
    assert REFUSALS[arguments] in message
    assert "secret" not in message


def test_prognoses_that_cannot_be_stored_are_printed_and_the_others_are_stored(
    emaphm: Emaphm, fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def curves(prognosis: Prognosis) -> Curves:
        if prognosis.evidence.unit == "SN-3":
            with History.open(fleet / "history.sqlite") as history:
                history.withdraw("SN-3", Mistake("recording", 50.0, "of SN-4"))
        return Curves.of(prognosis)

    monkeypatch.setattr("emaphm.prognosis.batch.all_units.Curves", SimpleNamespace(of=curves))
    chosen = ("prognose", "--all", "--no-fleet", "--workers", "1", "--keep", "--json")
    code, out, err = emaphm(*chosen)
    assert code == 2
    assert [unit["unit"] for unit in json.loads(out)["units"]] == ["SN-1", "SN-2", "SN-3"]
    assert "1 of 3 prognoses could not be stored, the others are; the first: no unit 'SN-3'" in err
    with History.open(fleet / "history.sqlite") as history:
        assert set(history.prognoses()) == {"SN-1", "SN-2"}


def test_a_prognosis_that_cannot_be_stored_is_printed(
    emaphm: Emaphm, fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert fleet.is_dir()

    def full(*_: object, **__: object) -> None:
        raise HistoryUnavailableError("history.sqlite: the database cannot be used (disk is full)")

    monkeypatch.setattr("emaphm.prognosis.keeping.keep_with_curves", full)
    code, out, err = emaphm("prognose", "--unit", "SN-3", "--no-fleet", "--keep", "--json")
    assert (code, json.loads(out)["unit"]) == (2, "SN-3")
    assert "disk is full" in err
