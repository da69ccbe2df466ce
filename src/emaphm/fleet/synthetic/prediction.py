"""Prediction of the remaining useful life of each unit of a synthetic fleet, with a prior from the others."""

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
"""Code that determines a prognosis for given evidence; the code that reads a history determines the
evidence."""


@dataclass(frozen=True)
class PredictionSetup:
    """Common inputs of the prognoses of a fleet: actuator with requirements, horizon [h], seed."""

    actuator: Actuator
    horizon: float
    seed: int


def predict_unit(evidence: Evidence, fleet: Fleet, setup: PredictionSetup) -> dict[str, Any]:
    """Return the output of `emaphm prognose --json` for a unit of a fleet."""
    prior = fleet.prior_of(evidence.unit, setup.actuator)
    prognosis = prognose(evidence, setup.actuator, Question(setup.horizon), prior=prior, seed=setup.seed)
    return {"synthetic": True, **prognosis.to_dict()}


def predict(
    units: Sequence[Evidence],
    fleet: Sequence[Evidence],
    setup: PredictionSetup,
    folder: FleetFolder,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    on_task: OnTask | None = None,
) -> None:
    """Write a line for each of `units`, predicted with a prior from the others of `fleet`.

    Existing predictions from the same diagnoses with the same code are not computed again.

    Raises
    ------
    ExecutionError
        Workers cannot be used, or some predictions failed; the other predictions are kept.
    OutputError
        The file cannot be written.
    """
    shared = Fleet.of(fleet, setup.seed)
    keys = keys_of(units, shared, setup)
    tasks = [
        Task(i, predict_unit, (unit, shared, setup), key, unit.unit)
        for i, (unit, key) in enumerate(zip(units, keys, strict=True))
    ]
    store = ResultStore(folder.work.results)
    failures = run_tasks(tasks, store, workers=workers, scheduler=scheduler, on_task=on_task)
    if failures:
        raise ExecutionError(
            f"predicting: {len(failures)} of {len(tasks)} units failed, the others are kept; the first: "
            f"{failures[0]}"
        )
    results, _ = store.read(tasks)
    lines = [json.dumps(finite(results[i].result), allow_nan=False) for i in sorted(results)]
    with written_whole(folder.prognoses) as temporary:
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def prognoses(folder: FleetFolder) -> list[dict[str, Any]]:
    """Return the prognoses of a folder, as printed by `emaphm prognose --json`."""
    lines = folder.prognoses.read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines]


def keys_of(units: Sequence[Evidence], fleet: Fleet, setup: PredictionSetup) -> list[str]:
    """Return keys of the prognoses of `units`: hashes of all inputs and of the code that determines them."""
    sources = [
        [fingerprint(source) for source in selection] for selection in (fleet.followed, fleet.pace_units)
    ]
    about = [sources, setup.actuator.model_dump(mode="json"), setup.horizon, setup.seed]
    code = revision_of(DECIDING, NOT_DECIDING)
    return [
        hashlib.sha256(json.dumps([fingerprint(unit), about, code]).encode()).hexdigest() for unit in units
    ]
