"""The folder of a study: its plan, and one Parquet part for each finished run.

A part is written beside its place and renamed, so it is there as a whole or not at all, and what is there
is never written again. A study that was stopped at any moment therefore goes on where it stood.
"""

import fcntl
import io
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import polars as pl

from emaphm.errors import StudyError
from emaphm.output_files import written_whole
from emaphm.study.plan import Plan, Task
from emaphm.study.revision import REVISION

SCHEMA: dict[str, pl.DataType | type[pl.DataType]] = {
    "index": pl.Int64,
    "case": pl.String,
    "method": pl.String,
    "model": pl.String,
    "fitness": pl.String,
    "equivalent": pl.String,
    "noise_A": pl.Float64,
    "run": pl.Int64,
    "seed": pl.Int64,
    "truth": pl.List(pl.Float64),
    "found": pl.List(pl.Float64),
    "error_percent": pl.Float64,
    "fitness_value": pl.Float64,
    "evaluations": pl.Int64,
    "reference_runs": pl.Int64,
    "seconds": pl.Float64,
    "curve_evaluations": pl.List(pl.Int64),
    "curve_fitness": pl.List(pl.Float64),
    "curve_error_percent": pl.List(pl.Float64),
    "revision": pl.String,
    "version": pl.String,
}
"""Columns of the results, one row a run. `index` numbers the run in the plan; `truth` and `found` are
fault vectors; the curves are the best so far after each population; `seconds` is wall time."""

PLAN = "plan.json"
PARTS = "runs"
LOCK = ".lock"

NOTHING = "nothing"
MOST_TOLD = 3
"""Differences between two plans that are told one by one."""


@dataclass(frozen=True)
class Store:
    """The folder of one study.

    `damaged` are the parts that are not whole, or not of the run that they are named after; these runs count
    as missing.
    """

    folder: Path
    plan: Plan
    results: pl.DataFrame
    damaged: tuple[Path, ...]

    @classmethod
    def create(cls, folder: str | Path, plan: Plan, *, mix: bool = False) -> Self:
        """Return the store of `plan` in `folder`, made where it is missing, with what is finished there.

        `mix` lets results of another version of the models stand.

        Raises
        ------
        StudyError
            The folder holds something else, another plan's results, or results of another version.
        """
        folder = Path(folder)
        if not (folder / PLAN).exists():
            _begin(folder, plan)
        store = cls.open(folder)
        difference = _difference(store.plan, plan)
        if difference:
            raise StudyError(
                f"{folder} holds results of another plan: {difference}; give another folder with -o"
            )
        store.check_revision(mix=mix)
        return store

    @classmethod
    def open(cls, folder: str | Path) -> Self:
        """Return the store in `folder` as it stands; `StudyError` if there is none."""
        folder = Path(folder)
        try:
            values = json.loads((folder / PLAN).read_text(encoding="utf-8"))
            plan = Plan.model_validate(values)
        except FileNotFoundError:
            raise StudyError(
                f"{folder} holds no study; give a folder that 'emaphm study run' wrote"
            ) from None
        except (OSError, ValueError) as error:
            reason = str(error).splitlines()[0]
            raise StudyError(f"{folder / PLAN}: cannot be read as a plan ({reason})") from None
        frames, damaged = [pl.DataFrame(schema=SCHEMA)], []
        for task in plan.tasks:
            part = _part(folder, task.index)
            if not part.exists():
                continue
            frame = _read(part, task)
            if frame is None:
                damaged.append(part)
            else:
                frames.append(frame)
        return cls(folder, plan, pl.concat(frames), tuple(damaged))

    def check_revision(self, *, mix: bool) -> None:
        """Refuse results of another version of the models, unless told to mix."""
        others = sorted(set(self.results["revision"]) - {REVISION})
        if others and not mix:
            raise StudyError(
                f"{self.folder} holds results of another version of the models ({', '.join(others)}; this is "
                f"{REVISION}); give another folder with -o, or --mix to let them stand"
            )

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep every other study out of the folder while the body runs, however the process ends."""
        with _locked(self.folder):
            yield

    def prepare(self) -> None:
        """Make room for parts, and remove what a killed study left half-written."""
        try:
            (self.folder / PARTS).mkdir(exist_ok=True)
            for temporary in (*self.folder.glob(".*.tmp"), *(self.folder / PARTS).glob(".*.tmp")):
                temporary.unlink()
        except OSError as error:
            raise _not_writable(self.folder, error) from None

    def add(self, row: Mapping[str, Any]) -> None:
        """Put one finished run on disk, whole; it takes the place of a damaged part."""
        content = io.BytesIO()  # polars itself says of a full disk that the file is no Parquet
        pl.DataFrame([row], schema=SCHEMA).write_parquet(content)
        with written_whole(_part(self.folder, row["index"])) as temporary:
            temporary.write_bytes(content.getbuffer())


def _begin(folder: Path, plan: Plan) -> None:
    if folder.exists() and not folder.is_dir():
        raise StudyError(f"{folder} is not a folder; give another name")
    if folder.is_dir() and any(not path.name.startswith(".") for path in folder.iterdir()):
        raise StudyError(f"{folder} holds something else than a study; give a new or empty folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StudyError(f"{folder} cannot be created ({error.strerror}); give another place") from None
    with _locked(folder):
        if not (folder / PLAN).exists():  # else another study has begun meanwhile
            with written_whole(folder / PLAN) as temporary:
                temporary.write_text(plan.model_dump_json(indent=1), encoding="utf-8")


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    try:
        lock = (folder / LOCK).open("w")
    except OSError as error:
        raise _not_writable(folder, error) from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StudyError(f"another study is running in {folder}; wait, or give another folder") from None
        except OSError as error:
            raise _not_writable(folder, error) from None
        yield


def _not_writable(folder: Path, error: OSError) -> StudyError:
    return StudyError(f"{folder} cannot be written to ({error.strerror}); give another folder with -o")


def _part(folder: Path, index: int) -> Path:
    return folder / PARTS / f"{index:07d}.parquet"


def _difference(there: Plan, here: Plan) -> str:
    """Return which keys differ between two plans, and how; empty if none does."""
    one, other = (dict(_leaves(plan.model_dump(mode="json"))) for plan in (there, here))
    keys = [key for key in {**one, **other} if one.get(key, NOTHING) != other.get(key, NOTHING)]
    told = [f"'{key}' ({one.get(key, NOTHING)} there, {other.get(key, NOTHING)} here)" for key in keys]
    more = f" and {len(keys) - MOST_TOLD} more" if len(keys) > MOST_TOLD else ""
    return ", ".join(told[:MOST_TOLD]) + more


def _leaves(value: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield the values in nested tables and lists as text, by their dotted keys."""
    if isinstance(value, list):
        value = {str(place): item for place, item in enumerate(value)}
    if not isinstance(value, dict) or not value:
        yield key, repr(value)
        return
    for name, item in value.items():
        yield from _leaves(item, f"{key}.{name}" if key else name)


def _read(part: Path, task: Task) -> pl.DataFrame | None:
    """Return the row of a part, or None where it is not whole or is not of `task`."""
    try:
        frame = pl.read_parquet(part)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError):
        return None
    expected = [task.index, task.case, task.contestant.label, task.seed]
    if frame.schema != pl.Schema(SCHEMA) or frame.height != 1:
        return None
    return frame if [frame[name][0] for name in ("index", "case", "method", "seed")] == expected else None
