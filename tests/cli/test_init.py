"""`emaphm init`: a first description from questions or from a built-in actuator."""

import io
import json
import tomllib
from pathlib import Path

import pytest

from emaphm.actuator import Actuator
from emaphm.actuator.unit.tolerances import Tolerances
from emaphm.first_description import ENDING, MACHINES, QUESTIONS, USUAL_TOLERANCE, template

from .conftest import Emaphm

ANSWERS = "pmsm\nRig 7\n28\n1.5\n\n4\n0.06\n10\n2e-5\n0.01\n-0.3, 0.4\n0.05\n"


@pytest.fixture
def answering(emaphm: Emaphm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Emaphm:
    def run(answers: str, *arguments: str) -> object:
        monkeypatch.setattr("sys.stdin", io.StringIO(answers))
        return emaphm("init", tmp_path / "rig.toml", *arguments)

    return run  # type: ignore[return-value]


@pytest.mark.parametrize("machine", MACHINES)
def test_a_built_in_actuator_needs_no_questions(machine: str, emaphm: Emaphm, tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    assert emaphm("init", path, "--from", machine).code == 0
    assert Actuator.from_toml(path) == template(machine)
    assert path.read_text(encoding="utf-8").startswith("# First description")


def test_the_description_holds_the_answers(answering: Emaphm, tmp_path: Path) -> None:
    answer = answering(ANSWERS, "--json")
    assert answer.code == 0
    assert (
        json.loads(answer.out)["answers"] == len(QUESTIONS) + 1
    )  # plus the name and the tolerance, minus the value that was not changed
    rig = Actuator.from_toml(tmp_path / "rig.toml")
    assert rig.name == "Rig 7"
    assert rig.electrical is not None
    assert (rig.electrical.supply, rig.electrical.resistance, rig.electrical.pole_pairs) == (28.0, 1.5, 4)
    assert rig.electrical.inductance == Actuator.pmsm().electrical.inductance  # type: ignore[union-attr]
    assert (rig.drive_constant, rig.motor.torque_constant) == (0.06, 0.06)
    assert rig.mechanics.end_stops == (-0.3, 0.4)
    assert rig.tolerances == Tolerances(torque_constant=0.05, resistance=0.05, inductance=0.05, inertia=0.05)


@pytest.mark.parametrize(
    ("answer", "tolerance"), [("", USUAL_TOLERANCE), ("0", None), ("10 %\n-1\n5\n0.2", 0.2)]
)
def test_a_tolerance_is_asked_for(
    answering: Emaphm, tmp_path: Path, answer: str, tolerance: float | None
) -> None:
    assert answering(ANSWERS.replace("0.05", answer)).code == 0
    tolerances = Actuator.from_toml(tmp_path / "rig.toml").tolerances
    assert (None if tolerances is None else tolerances.torque_constant) == tolerance


@pytest.mark.parametrize(("answer", "stops"), [("", (-0.5236, 0.5236)), ("none", None)])
def test_end_stops_stay_without_an_answer_and_are_removed_by_none(
    answering: Emaphm, tmp_path: Path, answer: str, stops: tuple[float, float] | None
) -> None:
    messages = answering(ANSWERS.replace("-0.3, 0.4", answer)).err
    assert "end stops at the user, lower and upper [rad], or none (-0.5236, 0.5236)" in messages
    assert Actuator.from_toml(tmp_path / "rig.toml").mechanics.end_stops == stops


def test_required_values_are_not_removed_by_none(answering: Emaphm, tmp_path: Path) -> None:
    answer = answering(ANSWERS.replace("\n4\n", "\nnone\n4\n"))
    assert answer.code == 0
    assert "pole_pairs" in answer.err
    assert "pole_pairs = 4" in (tmp_path / "rig.toml").read_text(encoding="utf-8")


def test_a_question_with_an_impossible_answer_is_repeated(answering: Emaphm, tmp_path: Path) -> None:
    answer = answering(ANSWERS.replace("1.5", "-3\nmuch\n1.5"))
    assert answer.code == 0
    assert "greater than 0" in answer.err
    assert "valid number" in answer.err
    assert "resistance = 1.5" in (tmp_path / "rig.toml").read_text(encoding="utf-8")


def test_answers_that_end_early_write_nothing(answering: Emaphm, tmp_path: Path) -> None:
    answer = answering("pmsm\nRig 7\n")
    assert answer.code == 2
    assert "--from" in answer.err
    assert not (tmp_path / "rig.toml").exists()


def test_the_printed_next_steps_can_be_run(
    emaphm: Emaphm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    printed = emaphm("init", "unit.toml", "--from", "dc").out.splitlines()
    _, calibrate, diagnose = (line.split()[1:] for line in printed if line.startswith("  emaphm"))
    # Only the recordings and the calibration are missing, which the user makes later.
    assert "healthy.csv" in emaphm(*calibrate).err
    (tmp_path / "unit-calibrated.toml").write_bytes((tmp_path / "unit.toml").read_bytes())
    assert "flight.csv" in emaphm(*diagnose).err


@pytest.mark.parametrize("name", ["bldc", "thesis"])
def test_a_machine_has_two_accepted_names(emaphm: Emaphm, tmp_path: Path, name: str) -> None:
    answer = emaphm("init", tmp_path / "rig.toml", "--from", name, "--json")
    assert json.loads(answer.out)["machine"] == "bldc"
    assert Actuator.load(name) == Actuator.thesis()


def test_an_unknown_machine_is_refused(answering: Emaphm) -> None:
    answer = answering("", "--from", "pmms")
    assert answer.code == 2
    assert "did you mean 'pmsm'" in answer.err


def test_the_kinds_of_machine_are_listed_one_per_line(answering: Emaphm) -> None:
    first, *listed = answering("nothing-like-it\n").err.splitlines()[: 1 + len(MACHINES)]
    assert first.startswith("An empty answer")
    assert (
        len({line.index(meaning) for line, (_, meaning) in zip(listed, MACHINES.values(), strict=True)}) == 1
    )


def test_an_existing_file_is_not_overwritten(answering: Emaphm, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text("mine", encoding="utf-8")
    assert answering("", "--from", "dc").code == 2
    assert (tmp_path / "rig.toml").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("machine", MACHINES)
def test_the_suggested_sections_are_valid(machine: str, emaphm: Emaphm, tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    emaphm("init", path, "--from", machine)
    prose, _, sections = ENDING.partition("\n\n")
    text = path.read_text(encoding="utf-8").replace(prose, "").replace("\n# ", "\n")
    suggested = tomllib.loads(sections)
    described = tomllib.loads(text[text.index("name =") :])
    assert described.items() >= suggested.items()
    Actuator.from_dict(described)
