"""Prognoses of the units of a synthetic fleet, with the other units as prior."""

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
"""Code that decides a prognosis for given evidence; the evidence is decided by the code of the history."""


@dataclass(frozen=True)
class PredictionSetup:
    """Common settings of a fleet's prognoses: the actuator with its requirements, the horizon [h], a seed."""

    actuator: Actuator
    horizon: float
    seed: int


def predict_unit(evidence: Evidence, fleet: Fleet, setup: PredictionSetup) -> dict[str, Any]:
    """Return the values of `emaphm prognose --json` for a unit of a fleet."""
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
    """Write the prognosis of each of `units`, with the other units of `fleet` as its prior, a line for each.

    A stored prognosis from the same diagnoses by the same code is used again.

    Raises
    ------
    ExecutionError
        Workers cannot be used, or some prognoses failed; the others are kept.
    OutputError
        The file cannot be written.
    """
    shared = Fleet.of(fleet, setup.seed)
    keys = keys_of(units, shared, setup)
    tasks = [
        Task(i, predict_unit, (evidence, shared, setup), key, evidence.unit)
        for i, (evidence, key) in enumerate(zip(units, keys, strict=True))
    ]
    store = ResultStore(folder.work.results)
    failures = run_tasks(tasks, store, workers=workers, scheduler=scheduler, on_task=on_task)
    if failures:
        raise ExecutionError(
            f"predicting: {len(failures)} of {len(tasks)} units failed, the others are kept; the first: "
            f"{failures[0]}"
        )
    outcomes, _ = store.read(tasks)
    lines = [json.dumps(finite(outcomes[i].result), allow_nan=False) for i in sorted(outcomes)]
    with written_whole(folder.prognoses) as temporary:
        temporary.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def prognoses(folder: FleetFolder) -> list[dict[str, Any]]:
    """Return the prognoses of a folder, with the values of `emaphm prognose --json`."""
    lines = folder.prognoses.read_text(encoding="utf-8").splitlines()
    return [json.loads(line) for line in lines]


def keys_of(units: Sequence[Evidence], fleet: Fleet, setup: PredictionSetup) -> list[str]:
    """Return the key of each unit's prognosis: a digest of all its inputs, and of the deciding code."""
    sources = [[fingerprint(unit) for unit in group] for group in (fleet.followed, fleet.pace_units)]
    shared = [sources, setup.actuator.model_dump(mode="json"), setup.horizon, setup.seed]
    code = revision_of(DECIDING, NOT_DECIDING)
    texts = [json.dumps([fingerprint(unit), shared, code]) for unit in units]
    return [hashlib.sha256(text.encode()).hexdigest() for text in texts]
