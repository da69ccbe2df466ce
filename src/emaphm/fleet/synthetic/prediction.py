"""The remaining useful life of each unit of a synthetic fleet, the others being its prior."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from emaphm.actuator import Actuator
from emaphm.diagnosis.deciding_code import NOT_DECIDING
from emaphm.errors import ExecutionError
from emaphm.execution import OnTask, ResultStore, Task, run_tasks
from emaphm.execution.revision import revision_of
from emaphm.fleet.synthetic.folder import FleetFolder
from emaphm.output_files import written_whole
from emaphm.prognosis import Evidence, Question, prognose
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.prognosis.from_fleet.fleet import Fleet
from emaphm.strict_json import finite

DECIDING = ("prognosis", "actuator", "quantiles.py", "random_streams.py", "strict_json.py")
"""Code that decides a prognosis, given the evidence: what reads a history decides that."""


@dataclass(frozen=True)
class PredictionSetup:
    """What the prognoses of a fleet share: the actuator with its requirements, the horizon [h], the seed."""

    actuator: Actuator
    horizon: float
    seed: int


def predict_unit(evidence: Evidence, fleet: Fleet, asked: PredictionSetup) -> dict[str, Any]:
    """Return what `emaphm prognose --json` prints of a unit of a fleet."""
    prior = fleet.prior_of(evidence.unit, asked.actuator)
    found = prognose(evidence, asked.actuator, Question(asked.horizon), prior=prior, seed=asked.seed)
    return {"synthetic": True, **found.to_dict()}


def predict(
    units: Sequence[Evidence],
    fleet: Sequence[Evidence],
    asked: PredictionSetup,
    folder: FleetFolder,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    on_task: OnTask | None = None,
) -> None:
    """Write a line for each of `units`, predicted with the others of `fleet` as its prior.

    What was predicted from the same diagnoses by the same code is not done again.

    Raises
    ------
    ExecutionError
        Workers cannot be used, or some predictions failed; the others are kept.
    OutputError
        The file cannot be written.
    """
    shared = Fleet.of(fleet, asked.seed)
    keys = keys_of(units, shared, asked)
    tasks = [
        Task(i, predict_unit, (one, shared, asked), key, one.unit)
        for i, (one, key) in enumerate(zip(units, keys, strict=True))
    ]
    store = ResultStore(folder.work.results)
    failures = run_tasks(tasks, store, workers=workers, scheduler=scheduler, on_task=on_task)
    if failures:
        raise ExecutionError(
            f"predicting: {len(failures)} of {len(tasks)} units failed, the others are kept; the first: "
            f"{failures[0]}"
        )
    found, _ = store.read(tasks)
    lines = [json.dumps(finite(found[i].result), allow_nan=False) for i in sorted(found)]
    with written_whole(folder.prognoses) as temporary:
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def prognoses(folder: FleetFolder) -> list[dict[str, Any]]:
    """Return the prognoses of a folder, as `emaphm prognose --json` prints them."""
    lines = folder.prognoses.read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines]


def keys_of(units: Sequence[Evidence], fleet: Fleet, asked: PredictionSetup) -> list[str]:
    """Return what identifies the prognosis of each unit: all it is computed from, and the deciding code."""
    sources = [[fingerprint(one) for one in chosen] for chosen in (fleet.followed, fleet.pace_units)]
    about = [sources, asked.actuator.model_dump(mode="json"), asked.horizon, asked.seed]
    code = revision_of(DECIDING, NOT_DECIDING)
    return [hashlib.sha256(json.dumps([fingerprint(one), about, code]).encode()).hexdigest() for one in units]
