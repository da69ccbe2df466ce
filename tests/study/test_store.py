"""The folder of a study: its files are complete and its own; other folders are refused."""

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from emaphm.errors import EmaphmError, ExecutionError, OutputError, StudyError
from emaphm.execution import ResultStore
from emaphm.execution import folder as folder_module
from emaphm.study import Plan, Store, run_study
from emaphm.study import store as store_module
from emaphm.study.revision import revision
from emaphm.study.store import SCHEMA, name_of, tasks
from emaphm.study.trials import trials_of

from . import small

PLAN = small.plan()


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Return a study run without interruption; tests use copies of its folder."""
    return run_study(PLAN, tmp_path_factory.mktemp("finished") / "study", workers=1)


@pytest.fixture
def folder(finished: Store, tmp_path: Path) -> Path:
    """Return a copy of the finished study's folder."""
    return Path(shutil.copytree(finished.folder, tmp_path / "study"))


def sql(folder: Path, statement: str, *values: Any) -> None:
    with sqlite3.connect(folder / "results.sqlite") as connection:
        connection.execute(statement, values)
    connection.close()


def key(index: int, plan: Plan = PLAN) -> str:
    return tasks(plan, trials_of(plan))[index].key


def forget(folder: Path, index: int) -> None:
    """Remove the result of one trial."""
    sql(folder, "DELETE FROM results WHERE key = ?", key(index))


def message(plan: Plan, folder: Path, **options: bool) -> str:
    """Return the message with which `plan` is refused in `folder`, and check that the folder is unchanged."""
    contents_before = _contents(folder)
    with pytest.raises(EmaphmError) as refusal:
        run_study(plan, folder, workers=1, **options)  # type: ignore[arg-type]
    assert _contents(folder) == contents_before
    assert len(str(refusal.value).splitlines()) == 1
    return str(refusal.value)


def _contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != ".lock"}


# Stored results


def test_each_trial_is_a_row(finished: Store) -> None:
    assert finished.results.schema == pl.Schema(SCHEMA)
    assert finished.results["index"].to_list() == list(range(12))
    assert finished.damaged == ()
    for trial, row in zip(trials_of(PLAN), finished.results.iter_rows(named=True), strict=True):
        assert (row["case"], row["method"], row["run"]) == (trial.case, trial.contestant.label, trial.run)
        assert (row["seed"], tuple(row["truth"])) == (trial.seed, trial.truth)
        assert 0 < row["seconds"] < row["wall_seconds"]
    # Only one of the times includes the bookkeeping between the trials.
    assert finished.elapsed_seconds > finished.results["wall_seconds"].sum()
    assert {path.name for path in finished.folder.iterdir()} == {"plan.json", "results.sqlite", ".lock"}


def test_a_reopened_store_has_the_same_results(finished: Store) -> None:
    reopened = Store.open(finished.folder)
    assert reopened.plan == PLAN
    assert reopened.results.equals(finished.results)


def test_a_finished_study_is_not_run_again(finished: Store, folder: Path) -> None:
    progress_calls: list[tuple[int, int]] = []
    repeated = run_study(PLAN, folder, on_run=lambda *progress: progress_calls.append(progress))
    assert repeated.results.equals(finished.results)
    assert progress_calls == [(12, 12)]


# Damaged rows, and rows of other work


def test_a_changed_row_is_named_and_only_its_trial_is_repeated(finished: Store, folder: Path) -> None:
    sql(
        folder,
        "UPDATE results SET result = replace(result, '\"found\": [0.', '\"found\": [0.1') WHERE key = ?",
        key(3),
    )
    opened = Store.open(folder)
    assert opened.damaged == (name_of(trials_of(PLAN)[3]),) == ("loose, more, run 0",)
    assert opened.results["index"].to_list() == [i for i in range(12) if i != 3]
    store = run_study(PLAN, folder, workers=1)
    assert store.damaged == opened.damaged
    assert small.table(store).equals(small.table(finished))
    assert store.results.filter(pl.col("index") != 3).equals(finished.results.filter(pl.col("index") != 3))
    assert Store.open(folder).damaged == ()


@pytest.mark.parametrize(
    ("change", "shared"),
    [
        (("friction = 0.3", "friction = 0.31"), 6),  # the other case
        (("population = 8", "population = 9"), 6),  # the other method
        (("duration = 0.05", "duration = 0.06"), 0),
        (("name =", 'models = ["monitor"]\nname ='), 0),
        (("name =", "noises_A = [0.1]\nname ="), 0),
        (("name =", 'fitnesses = ["thesis"]\nname ='), 0),
        (("name =", "seed = 1\nname ="), 0),
    ],
    ids=["truth", "setting", "manoeuvre", "model", "noise", "fitness", "seed"],
)
def test_copied_results_of_another_plan_do_not_count(
    folder: Path, tmp_path: Path, change: tuple[str, str], shared: int
) -> None:
    other_plan = small.plan(change)
    Store.create(tmp_path / "other", other_plan)
    shutil.copy(folder / "results.sqlite", tmp_path / "other")
    store = Store.open(tmp_path / "other")
    assert store.results.height == shared
    assert store.damaged == ()


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-5000])


def _scribble(path: Path) -> None:
    path.write_text("no results", encoding="utf-8")


@pytest.mark.parametrize("spoil", [_cut, _scribble])
def test_a_damaged_file_is_refused_and_unchanged(folder: Path, spoil: Callable[[Path], None]) -> None:
    spoil(folder / "results.sqlite")
    assert message(PLAN, folder).startswith(f"{folder / 'results.sqlite'}: is damaged (")
    with pytest.raises(ExecutionError, match="move it away"):
        Store.open(folder)


def test_a_run_that_cannot_be_written_leaves_other_runs_intact(
    finished: Store, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The effect of a full disk on the file is tested with the store of results.
    for index in (5, 6):
        forget(folder, index)
    with monkeypatch.context() as patch:
        patch.setattr(folder_module, "RESULTS", "absent/results.sqlite")
        with pytest.raises(OutputError, match="cannot be written or read"):
            run_study(PLAN, folder, workers=1)
    assert Store.open(folder).results.height == 10
    assert small.table(run_study(PLAN, folder, workers=1)).equals(small.table(finished))


def test_only_temporary_files_of_a_killed_study_are_removed(folder: Path) -> None:
    temporary, own = (
        folder / f".{'0a' * 16}.tmp",
        (folder / ".mine.tmp", folder / "notes.tmp", folder / ".0123.tmp"),
    )
    for path in (temporary, *own):
        path.write_text("{", encoding="utf-8")
    run_study(PLAN, folder, workers=1)
    assert not temporary.exists()
    assert all(path.exists() for path in own)


# Folders of other work


def test_a_new_study_creates_its_folder_or_uses_an_empty_folder(tmp_path: Path) -> None:
    plan = small.plan(("runs = 3", "runs = 1"))
    assert run_study(plan, tmp_path / "a" / "b", workers=1).results.height == 4
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / ".DS_Store").touch()
    assert run_study(plan, tmp_path / "empty", workers=1).results.height == 4


def test_a_study_stopped_before_its_first_run_is_resumed(tmp_path: Path) -> None:
    Store.create(tmp_path / "begun", PLAN)
    assert {path.name for path in (tmp_path / "begun").iterdir()} == {"plan.json", ".lock"}
    assert run_study(PLAN, tmp_path / "begun", workers=1).results.height == 12


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        (("runs = 3", "runs = 4"), "'runs' (3 there, 4 here)"),
        (("name =", "seed = 7\nname ="), "'seed' (0 there, 7 here)"),
        (("friction = 0.3", "friction = 0.31"), "'cases.worn.friction' (0.3 there, 0.31 here)"),
        (("friction = 0.3", "gain = 0.3"), "'cases.worn.friction' (0.3 there, nothing here)"),
        (("population = 8", "population = 9"), "'methods.1.population' (8 there, 9 here)"),
        (("duration = 0.05", "duration = 0.06"), "'manoeuvre.duration' (0.05 there, 0.06 here)"),
        (("name =", 'models = ["monitor"]\nname ='), "'models.0' ('averaged' there, 'monitor' here)"),
        (("[cases]", "[random]\ncount = 2\n[cases]"), "'random' (None there, nothing here), 'random.count'"),
        (
            ("[cases]", "[cases]\nmild = { gain = 0.6, friction = 0.1, short_a = 0.2, short_b = 0 }"),
            "1 more;",
        ),
    ],
)
def test_results_of_another_plan_are_refused_with_the_difference(
    folder: Path, change: tuple[str, str], difference: str
) -> None:
    text = message(small.plan(change), folder)
    assert text.startswith(f"{folder} holds results of another plan: ")
    assert text.endswith("; give another folder with -o")
    assert difference in text


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("Dear all", encoding="utf-8")
    assert "holds something else than a study; give a new or empty folder" in message(PLAN, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"letter.txt"}


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "study").touch()
    assert "is not a folder" in message(PLAN, tmp_path / "study")
    assert "cannot be created (Not a directory)" in message(PLAN, tmp_path / "study" / "below")


@pytest.mark.parametrize(
    "content", ["", "{", "[]", '{"name": "small"}', "\x00", "[" * 100_000, "null", '"a"']
)
def test_an_unreadable_plan_is_named_in_the_message(folder: Path, content: str) -> None:
    (folder / "plan.json").write_text(content, encoding="utf-8")
    text = message(PLAN, folder)
    assert f"{folder / 'plan.json'}: cannot be read as a plan (" in text
    assert "give another folder with -o" in text


def test_a_folder_without_a_study_cannot_be_opened(tmp_path: Path) -> None:
    for place in (tmp_path, tmp_path / "absent"):
        with pytest.raises(StudyError, match="holds no study; give a folder that 'emaphm study run' wrote"):
            Store.open(place)


def test_a_study_that_cannot_be_written_to_is_refused(folder: Path) -> None:
    # Permissions do not apply to root; a name in use fails at the same place.
    (folder / ".lock").unlink()
    (folder / ".lock").mkdir()
    assert f"{folder} cannot be written to (" in message(PLAN, folder)


def test_a_folder_that_cannot_be_created_is_refused() -> None:
    if not Path("/proc/self").is_dir():
        pytest.skip("needs a file system that nobody can write to")
    with pytest.raises(StudyError, match=r"/proc/study cannot be created \(.*\); give another place"):
        run_study(PLAN, "/proc/study")


# Other versions of the models


def test_results_of_another_version_are_refused_unless_mixing_is_requested(
    finished: Store, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    forget(folder, 2)
    current = revision()
    with monkeypatch.context() as patch:
        patch.setattr(store_module, "revision", lambda: "0123456789ab")
        text = message(PLAN, folder)
    assert f"results of another version of the models ({current}; this is 0123456789ab)" in text
    assert "--mix" in text
    mixed = ResultStore(folder / "results.sqlite")
    outcome = mixed.read(tasks(PLAN, trials_of(PLAN)))[0][1]
    with mixed.writing() as writer:
        outcome.result.update(revision="0123456789ab", fitness_value=77.0)
        writer.keep(tasks(PLAN, trials_of(PLAN))[1], outcome, "another", 1.0)
    assert "another version of the models (0123456789ab; this is " in message(PLAN, folder)
    results = run_study(PLAN, folder, workers=1, mix=True).results
    assert results["fitness_value"][1] == 77.0
    other_rows = pl.col("index") != 1
    assert small.timeless(results).filter(other_rows).equals(small.table(finished).filter(other_rows))


# Simultaneous studies


def test_a_second_study_in_the_same_folder_is_refused(finished: Store, folder: Path) -> None:
    forget(folder, 4)
    refusals = []

    def start_another(done: int, total: int) -> None:
        assert done <= total
        with pytest.raises(StudyError) as refusal:
            run_study(PLAN, folder, workers=1)
        refusals.append(str(refusal.value))

    store = run_study(PLAN, folder, workers=1, on_run=start_another)
    expected = f"another study is running in {folder}; wait, or give another folder"
    assert refusals == [expected, expected]
    assert small.table(store).equals(small.table(finished))
    run_study(PLAN, folder, workers=1)  # and is accepted afterwards


def test_two_studies_that_start_in_one_folder_do_not_mix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, other_plan = tmp_path / "study", small.plan(("runs = 3", "runs = 1"))
    locked = Store.locked

    def overtaken(self: Store) -> object:
        # Another plan takes the folder between the first check and the lock.
        (folder / "plan.json").unlink()
        Store.create(folder, other_plan)
        return locked(self)

    monkeypatch.setattr(Store, "locked", overtaken)
    with pytest.raises(StudyError, match=r"another plan: 'runs' \(1 there, 3 here\)"):
        run_study(PLAN, folder, workers=1)
    assert not (folder / "results.sqlite").exists()
