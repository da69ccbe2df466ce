"""The folder of a study: what is in it is whole, and its own; every other folder is refused."""

import shutil
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from emaphm.errors import EmaphmError, OutputError, StudyError
from emaphm.study import Plan, Store, run_study
from emaphm.study.store import SCHEMA

from . import small

PLAN = small.plan()


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Return a study that nothing has disturbed; tests work on copies of its folder."""
    return run_study(PLAN, tmp_path_factory.mktemp("finished") / "study", workers=1)


@pytest.fixture
def folder(finished: Store, tmp_path: Path) -> Path:
    """Return a copy of the finished study's folder."""
    return Path(shutil.copytree(finished.folder, tmp_path / "study"))


def part(folder: Path, index: int) -> Path:
    return folder / "runs" / f"{index:07d}.parquet"


def stamps(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in (folder / "runs").iterdir()}


def message(plan: Plan, folder: Path, **options: bool) -> str:
    """Return why `plan` is refused in `folder`, which is left as it is."""
    before = _contents(folder)
    with pytest.raises(EmaphmError) as refusal:
        run_study(plan, folder, workers=1, **options)  # type: ignore[arg-type]
    assert _contents(folder) == before
    assert len(str(refusal.value).splitlines()) == 1
    return str(refusal.value)


def _contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != ".lock"}


# What is kept


def test_every_run_is_a_row_of_its_part(finished: Store) -> None:
    assert finished.results.schema == pl.Schema(SCHEMA)
    assert finished.results["index"].to_list() == list(range(12))
    assert finished.damaged == ()
    for task, row in zip(PLAN.tasks, finished.results.iter_rows(named=True), strict=True):
        assert (row["case"], row["method"], row["run"]) == (task.case, task.contestant.label, task.run)
        assert (row["seed"], tuple(row["truth"])) == (task.seed, task.truth)
        assert pl.read_parquet(part(finished.folder, task.index)).row(0, named=True) == row


def test_a_reopened_store_is_the_same(finished: Store) -> None:
    again = Store.open(finished.folder)
    assert again.plan == PLAN
    assert again.results.equals(finished.results)


def test_a_finished_study_is_not_run_again(folder: Path) -> None:
    before, told = stamps(folder), []
    run_study(PLAN, folder, on_run=lambda *progress: told.append(progress))
    assert stamps(folder) == before
    assert told == [(12, 12)]


# Parts that are not whole, or not theirs


def _truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def _empty(path: Path) -> None:
    path.write_bytes(b"")


def _scribble(path: Path) -> None:
    path.write_text("no Parquet", encoding="utf-8")


def _other_columns(path: Path) -> None:
    pl.DataFrame({"index": [3], "error_percent": [1.0]}).write_parquet(path)


def _other_run(path: Path) -> None:
    shutil.copy(part(path.parents[1], 2), path)


def _other_study(path: Path) -> None:
    rows = pl.read_parquet(path).with_columns(seed=pl.col("seed") + 1)
    rows.write_parquet(path)


def _two_rows(path: Path) -> None:
    rows = pl.read_parquet(path)
    pl.concat([rows, rows]).write_parquet(path)


@pytest.mark.parametrize(
    "spoil", [_truncate, _empty, _scribble, _other_columns, _other_run, _other_study, _two_rows]
)
def test_a_spoilt_part_is_named_and_only_its_run_done_again(
    finished: Store, folder: Path, spoil: Callable[[Path], None]
) -> None:
    spoil(part(folder, 3))
    before = stamps(folder)
    opened = Store.open(folder)
    assert opened.damaged == (part(folder, 3),)
    assert opened.results["index"].to_list() == [i for i in range(12) if i != 3]
    store = run_study(PLAN, folder, workers=1)
    assert store.damaged == (part(folder, 3),)
    assert small.table(store).equals(small.table(finished))
    after = stamps(folder)
    assert {name for name in after if after[name] != before[name]} == {part(folder, 3).name}
    assert Store.open(folder).damaged == ()


@pytest.mark.parametrize("length", range(0, 5000, 500))
def test_a_part_cut_at_any_length_is_seen(folder: Path, length: int) -> None:
    whole = part(folder, 0).read_bytes()
    assert len(whole) > length
    part(folder, 0).write_bytes(whole[:length])
    assert Store.open(folder).damaged == (part(folder, 0),)


def test_a_run_that_cannot_be_written_leaves_no_part_of_it(finished: Store, folder: Path) -> None:
    resource = pytest.importorskip("resource")
    part(folder, 5).unlink()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2500, limits[1]))  # half a part
    try:
        with pytest.raises(OutputError, match=r"0000005\.parquet: cannot be written \(File too large\)"):
            run_study(PLAN, folder, workers=1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(stamps(folder)) == 11
    assert small.table(run_study(PLAN, folder, workers=1)).equals(small.table(finished))


@pytest.mark.parametrize("left", [".0123.tmp", "runs/.0123.tmp"])
def test_what_a_killed_study_left_is_removed(folder: Path, left: str) -> None:
    (folder / left).write_bytes(b"PAR1")
    run_study(PLAN, folder, workers=1)
    assert not (folder / left).exists()


# Folders that are something else


def test_a_new_study_makes_its_folder_and_takes_an_empty_one(tmp_path: Path) -> None:
    plan = small.plan(("runs = 3", "runs = 1"))
    assert run_study(plan, tmp_path / "a" / "b", workers=1).results.height == 4
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / ".DS_Store").touch()
    assert run_study(plan, tmp_path / "empty", workers=1).results.height == 4


def test_a_study_stopped_before_its_first_run_goes_on(tmp_path: Path) -> None:
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
def test_results_of_another_plan_are_refused_and_the_difference_named(
    folder: Path, change: tuple[str, str], difference: str
) -> None:
    said = message(small.plan(change), folder)
    assert said.startswith(f"{folder} holds results of another plan: ")
    assert said.endswith("; give another folder with -o")
    assert difference in said


def test_a_folder_with_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("Dear all", encoding="utf-8")
    assert "holds something else than a study; give a new or empty folder" in message(PLAN, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"letter.txt"}


def test_a_file_in_its_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "study").touch()
    assert "is not a folder" in message(PLAN, tmp_path / "study")
    assert "cannot be created (Not a directory)" in message(PLAN, tmp_path / "study" / "below")


@pytest.mark.parametrize("content", ["", "{", "[]", '{"name": "small"}', "\x00"])
def test_a_plan_that_cannot_be_read_is_named(folder: Path, content: str) -> None:
    (folder / "plan.json").write_text(content, encoding="utf-8")
    assert f"{folder / 'plan.json'}: cannot be read as a plan (" in message(PLAN, folder)


def test_a_folder_without_study_cannot_be_opened(tmp_path: Path) -> None:
    for place in (tmp_path, tmp_path / "absent"):
        with pytest.raises(StudyError, match="holds no study; give a folder that 'emaphm study run' wrote"):
            Store.open(place)


@pytest.mark.parametrize("taken", [".lock", "runs"])
def test_a_study_that_cannot_be_written_to_is_refused(folder: Path, taken: str) -> None:
    # Permissions do not hold root back; a name that is taken fails in the same place.
    if taken == ".lock":
        (folder / ".lock").unlink()
        (folder / ".lock").mkdir()
    else:
        shutil.rmtree(folder / "runs")
        (folder / "runs").touch()
    assert f"{folder} cannot be written to (" in message(PLAN, folder)


def test_a_place_where_nothing_can_be_made_is_refused() -> None:
    if not Path("/proc/self").is_dir():
        pytest.skip("needs a file system that nobody can write to")
    with pytest.raises(StudyError, match=r"/proc/study cannot be created \(.*\); give another place"):
        run_study(PLAN, "/proc/study")


# Other versions of the models


def test_results_of_another_version_are_refused_unless_told_to_mix(finished: Store, folder: Path) -> None:
    another = pl.read_parquet(part(folder, 1)).with_columns(
        revision=pl.lit("0123456789ab"), error_percent=pl.lit(77.0)
    )
    another.write_parquet(part(folder, 1))
    part(folder, 2).unlink()
    said = message(PLAN, folder)
    assert "results of another version of the models (0123456789ab; this is " in said
    assert "--mix" in said
    mixed = run_study(PLAN, folder, workers=1, mix=True).results
    assert mixed["error_percent"][1] == 77.0
    assert (
        mixed.filter(pl.col("index") != 1)
        .drop("seconds")
        .equals(small.table(finished).filter(pl.col("index") != 1))
    )


# Two at once


def test_a_second_study_in_the_same_folder_is_refused(finished: Store, folder: Path) -> None:
    part(folder, 4).unlink()
    refusals = []

    def start_another(done: int, total: int) -> None:
        assert done <= total
        with pytest.raises(StudyError) as refusal:
            run_study(PLAN, folder, workers=1)
        refusals.append(str(refusal.value))

    store = run_study(PLAN, folder, workers=1, on_run=start_another)
    wanted = f"another study is running in {folder}; wait, or give another folder"
    assert refusals == [wanted, wanted]
    assert small.table(store).equals(small.table(finished))
    run_study(PLAN, folder, workers=1)  # and is let in afterwards


def test_two_studies_that_begin_in_one_folder_do_not_mix(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, other = tmp_path / "study", small.plan(("runs = 3", "runs = 1"))
    locked = Store.locked

    def overtaken(self: Store) -> object:
        # Another plan takes the folder between the first look and the lock.
        (folder / "plan.json").unlink()
        Store.create(folder, other)
        return locked(self)

    monkeypatch.setattr(Store, "locked", overtaken)
    with pytest.raises(StudyError, match=r"another plan: 'runs' \(1 there, 3 here\)"):
        run_study(PLAN, folder, workers=1)
    assert not (folder / "runs").exists()
