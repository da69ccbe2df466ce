"""The folder of a study: its plan, and a file of results with one row per trial.

A study can be stopped at any time and resumed. The plan identifies a trial; the key of its result is a digest
of everything that decides the result, so that results cannot be mistaken for each other.
"""

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import polars as pl

from emaphm.diagnosis.error_metric import error_percent
from emaphm.errors import StudyError
from emaphm.execution.folder import WorkFolder, difference
from emaphm.execution.store import ResultStore
from emaphm.execution.tasks import Outcome, Task
from emaphm.input_files import content_digest, exists
from emaphm.study.plan import Plan
from emaphm.study.revision import revision
from emaphm.study.task import perform
from emaphm.study.trials import Trial, trials_of

Schema = dict[str, pl.DataType | type[pl.DataType]]

IDENTITY: Schema = {
    "index": pl.Int64,
    "group": pl.String,
    "rig": pl.String,
    "case": pl.String,
    "case_kind": pl.String,
    "method": pl.String,
    "model": pl.String,
    "fitness": pl.String,
    "equivalent": pl.String,
    "noise_A": pl.Float64,
    "run": pl.Int64,
    "seed": pl.Int64,
    "truth": pl.List(pl.Float64),
}
"""Columns that identify a trial. `index` is its number in the plan; `truth` is a fault vector; `rig` is empty
for the noise-free recording of the actuator as described."""

MEASURED: Schema = {
    "found": pl.List(pl.Float64),
    "fitness_value": pl.Float64,
    "evaluations": pl.Int64,
    "reference_runs": pl.Int64,
    "seconds": pl.Float64,
    "curve_evaluations": pl.List(pl.Int64),
    "curve_fitness": pl.List(pl.Float64),
    "curve_error_percent": pl.List(pl.Float64),
    "lower95": pl.List(pl.Float64),
    "upper95": pl.List(pl.Float64),
    "standard_error": pl.List(pl.Float64),
    "verdict": pl.List(pl.String),
    "explained": pl.Boolean,
    "moves": pl.Boolean,
    "revision": pl.String,
    "version": pl.String,
}
"""Columns with the result of a trial. `found` is a fault vector; the curves are the best values after each
population; `seconds` is the wall time of the identification. Intervals, standard errors and verdicts, by
component, and the flags of a diagnosis are null for a search without diagnosis."""

SCHEMA: Schema = {
    **IDENTITY,
    **MEASURED,
    "error_percent": pl.Float64,
    "wall_seconds": pl.Float64,
    "cpu_seconds": pl.Float64,
}
"""Columns of the results, one row per trial: in addition the error of `found`, and the wall and processor
time of the whole trial with its recording."""

PLAN = "plan.json"


@dataclass(frozen=True)
class Store:
    """The folder of one study.

    `damaged` names the trials whose row is damaged; these count as missing. `elapsed_seconds` is the wall
    time for which the study was running, without interruptions.
    """

    folder: Path
    plan: Plan
    results: pl.DataFrame
    damaged: tuple[str, ...]
    elapsed_seconds: float

    @classmethod
    def create(cls, folder: str | Path, plan: Plan, *, mix: bool = False) -> Self:
        """Return the store of `plan` in `folder`, created if it is missing, with its finished results.

        `mix` permits results of another version of the models.

        Raises
        ------
        StudyError
            The folder contains other files, results of another plan, or results of another version.
        ExecutionError, OutputError
            Its results are damaged, or cannot be read.
        """
        folder = Path(folder)
        if not exists(folder / PLAN, StudyError):
            _folder(folder).begin(plan.model_dump_json(indent=1))
        store = cls.open(folder)
        differing = difference(*(compared.model_dump(mode="json") for compared in (store.plan, plan)))
        if differing:
            raise StudyError(
                f"{folder} holds results of another plan: {differing}; give another folder with -o"
            )
        store.check_revision(mix=mix)
        return store

    @classmethod
    def open(cls, folder: str | Path) -> Self:
        """Return the existing store in `folder`; errors as in `create`."""
        folder = Path(folder)
        try:
            values = json.loads((folder / PLAN).read_text(encoding="utf-8"))
            plan = Plan.model_validate(values)
        except (FileNotFoundError, NotADirectoryError):
            raise StudyError(
                f"{folder} holds no study; give a folder that 'emaphm study run' wrote"
            ) from None
        except (OSError, ValueError, RecursionError) as error:
            reason = str(error).splitlines()[0]
            raise StudyError(
                f"{folder / PLAN}: cannot be read as a plan ({reason}); restore the file, or give another "
                "folder with -o"
            ) from None
        trials = trials_of(plan)
        kept = ResultStore(_folder(folder).results)
        outcomes, damaged = kept.read(tasks(plan, trials))
        rows = [_row(trial, outcomes[trial.index]) for trial in trials if trial.index in outcomes]
        return cls(
            folder,
            plan,
            pl.DataFrame(rows, schema=SCHEMA),
            tuple(name_of(trials[index]) for index in damaged),
            kept.elapsed_seconds(),
        )

    @property
    def kept(self) -> ResultStore:
        """The file of results."""
        return ResultStore(_folder(self.folder).results)

    def check_revision(self, *, mix: bool) -> None:
        """Refuse results of another version of the models, unless `mix` allows them."""
        others = sorted(set(self.results["revision"]) - {revision()})
        if others and not mix:
            raise StudyError(
                f"{self.folder} holds results of another version of the models ({', '.join(others)}; this is "
                f"{revision()}); give another folder with -o, or --mix to keep them"
            )

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Lock the folder against other processes while the body runs; released also if the process dies."""
        with _folder(self.folder).locked():
            yield

    def clear(self) -> None:
        """Remove half-written files of a killed process."""
        _folder(self.folder).clear()


def tasks(plan: Plan, trials: tuple[Trial, ...]) -> list[Task]:
    """Return the tasks of the `trials` of `plan`; a task's key covers everything that decides its result."""
    common = {
        "columns": sorted(MEASURED),
        "plan": plan.model_dump(mode="json", include={"actuator", "manoeuvre"}),
    }
    base = hashlib.sha256(json.dumps(common, sort_keys=True).encode())
    dumped = {id(part): part.model_dump(mode="json") for part in (*plan.methods, *plan.rigs)}
    dumped[id(None)] = {}
    estimators: dict[int, str] = {}
    for method in plan.methods:
        if method.estimator is not None:
            dumped[id(method)]["estimator"] = estimators[id(method)] = _content(method.estimator)
    made = []
    for trial in trials:
        values = {name: value for name, value in vars(trial).items() if name not in ("index", "rank", "of")}
        values["contestant"], values["rig"] = dumped[id(trial.contestant)], dumped[id(trial.rig)]
        digest = base.copy()
        digest.update(json.dumps(values, sort_keys=True).encode())
        arguments = (plan.actuator, plan.manoeuvre, trial, revision(), estimators.get(id(trial.contestant)))
        made.append(Task(trial.index, perform, arguments, digest.hexdigest(), name_of(trial)))
    return made


def _content(estimator: str) -> str:
    """Return a digest of an estimator's file: another estimator gives other results."""
    digest = content_digest(Path(estimator))
    if not digest:
        raise StudyError(f"{estimator}: the estimator of the study cannot be read; restore the file")
    return digest


def name_of(trial: Trial) -> str:
    """Return the name of a trial for messages."""
    rig = () if trial.rig is None else (trial.rig.label,)
    return ", ".join((*rig, trial.case, trial.contestant.label, f"run {trial.run}"))


def identity(trial: Trial) -> dict[str, Any]:
    """Return the columns `IDENTITY` of the row of a trial."""
    return {
        "index": trial.index,
        "group": trial.group,
        "rig": "" if trial.rig is None else trial.rig.label,
        "case": trial.case,
        "case_kind": trial.case_kind,
        "method": trial.contestant.label,
        "model": trial.model,
        "fitness": trial.fitness,
        "equivalent": trial.equivalent,
        "noise_A": trial.noise_A,
        "run": trial.run,
        "seed": trial.seed,
        "truth": list(trial.truth),
    }


def _row(trial: Trial, outcome: Outcome) -> dict[str, Any]:
    return {
        **identity(trial),
        **outcome.result,
        "error_percent": float(error_percent(trial.truth, outcome.result["found"])),
        "wall_seconds": outcome.wall_seconds,
        "cpu_seconds": outcome.cpu_seconds,
    }


def _folder(folder: Path) -> WorkFolder:
    return WorkFolder(folder, PLAN, "study", StudyError)
