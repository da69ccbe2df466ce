"""Execution of the study: simulation and diagnosis of a synthetic fleet, then evaluation of predictions."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from emaphm.actuator import Actuator
from emaphm.errors import StudyError
from emaphm.execution import OnTask, Task, outcomes, run_tasks
from emaphm.execution.revision import revision_of
from emaphm.execution.store import ResultStore
from emaphm.fleet.synthetic import Chain, FleetFolder, FleetPlan, SyntheticUnit, drawn_unit, run_chain
from emaphm.fleet.synthetic.recordings import fleet_actuator
from emaphm.history import History
from emaphm.output_files import make_folder
from emaphm.prognosis import Evidence, Prior, fleet_prior
from emaphm.prognosis.from_fleet.fingerprint import fingerprint
from emaphm.study.fleet.drawn import DiagnosisPool, drawn_evidence
from emaphm.study.fleet.judging import FailedUnit, judged

PLAN = FleetPlan(units=104, flights=70, interval=100.0, seed=1)
"""Plan of the recorded level: all but one or two units fail within 7,000 h."""

MANY = FleetPlan(units=200, flights=70, interval=100.0, seed=2)
"""Plan of the level with drawn diagnoses."""

PARTS = 13
"""Parts of the recorded level; each is evaluated with the other parts as its fleet: 96 of 104 units."""

RESULTS = "results.sqlite"

RECORDED, DRAWN = "recorded", "drawn"
"""Levels of the study: diagnoses of recordings, and diagnoses drawn from the covariances of the former."""

FLEET_UNITS, JUDGED = 30, 100
"""In the level with drawn diagnoses: number of the first units, which are the fleet, and of the evaluated
units after them. All other units belong to the larger fleet, together with the first units."""

FEWEST = 4
"""Least number of explained diagnoses of an evaluated unit: no method can predict an earlier failure."""

DECIDING = ("prognosis", "fleet/synthetic", "study/fleet", "actuator", "quantiles.py", "random_streams.py")
"""Code that decides the results for given evidence; the evidence depends on the code of the history."""

NOT_DECIDING = (
    "actuator/toml",
    "study/fleet/__main__.py",
    "study/fleet/scores.py",
    "study/fleet/acting.py",
)

T = TypeVar("T")


@dataclass(frozen=True)
class StudyFolder:
    """The folder of the study: the fleet with its recordings in ``fleet``, and the results next to it.

    The recorded level has the first `units` of `PLAN`.
    """

    path: Path
    units: int = PLAN.units

    @property
    def plan(self) -> FleetPlan:
        """The plan of the recorded level."""
        return replace(PLAN, units=self.units)

    @property
    def fleet(self) -> FleetFolder:
        """The synthetic fleet of the recorded level."""
        return FleetFolder(self.path / "fleet")

    @property
    def results(self) -> ResultStore:
        """The file of results."""
        return ResultStore(self.path / RESULTS)


def run(
    folder: StudyFolder,
    *,
    workers: int | None = None,
    on_step: Callable[[str], OnTask | None] = lambda _: None,
) -> None:
    """Compute the missing results of both levels.

    Raises
    ------
    StudyError
        Some units could not be evaluated; results of the others are stored.
    ExecutionError, HistoryError, OutputError
        Workers, the folder or the history cannot be used.
    """
    make_folder(folder.path)
    run_chain(Chain(folder.plan, folder.fleet, workers=workers, on_step=on_step))
    work = _work(folder)
    done = folder.results.finished(_tasks(work, {}))
    missing = [item for i, item in enumerate(work) if i not in done]
    chosen = _tasks(work, _learnt(missing, workers, on_step("learning from fleets")))
    failures = run_tasks(chosen, folder.results, workers=workers, on_task=on_step("judging"))
    if failures:
        raise StudyError(f"{len(failures)} of {len(chosen)} units failed, the first: {failures[0]}")


def results(folder: StudyFolder) -> dict[str, list[dict[str, Any]]]:
    """Return the results by level, one per evaluated unit; errors as in `run`."""
    work = _work(folder)
    done, _ = folder.results.read(_tasks(work, {}))
    by_level: dict[str, list[dict[str, Any]]] = {RECORDED: [], DRAWN: []}
    for i, outcome in sorted(done.items()):
        by_level[work[i].level].append(outcome.result)
    return by_level


def recorded_fleet(folder: StudyFolder) -> list[tuple[SyntheticUnit, Evidence]]:
    """Return the units of the recorded level with their diagnoses and their recorded stress."""
    with History.open(folder.fleet.history) as history:
        units = [drawn_unit(folder.plan, i) for i in range(folder.units)]
        return [(unit, Evidence.of(history.unit(unit.serial_number))) for unit in units]


@dataclass(frozen=True, eq=False)
class KnownFleet:
    """The fleet of predicted units: other units, their hours of failure [h], and perhaps a larger fleet."""

    name: str
    others: tuple[Evidence, ...]
    lives: tuple[float, ...]
    larger: tuple[Evidence, ...] = ()

    @cached_property
    def digest(self) -> str:
        """Digest that identifies the fleet."""
        known = [[fingerprint(evidence) for evidence in units] for units in (self.others, self.larger)]
        return hashlib.sha256(json.dumps([known, self.lives]).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class Work:
    """A failed unit to be evaluated, its diagnoses, and the fleet that is used for its prediction."""

    level: str
    fleet: KnownFleet
    plan: FleetPlan
    unit: SyntheticUnit
    evidence: Evidence

    @property
    def actuator(self) -> Actuator:
        """The actuator of the fleet, with its requirements."""
        return fleet_actuator(self.plan.drawn_from)

    def key(self, code: str) -> str:
        """Return the key of the result: a digest of everything that decides it, with plan and unit."""
        parts = [self.level, self.plan.to_dict(), self.unit.serial_number, fingerprint(self.evidence)]
        parts += [self.fleet.digest, self.actuator.model_dump(mode="json"), code]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _work(folder: StudyFolder) -> list[Work]:
    recorded = recorded_fleet(folder)
    pool = DiagnosisPool.of([evidence for _, evidence in recorded])
    units = (drawn_unit(MANY, i) for i in range(MANY.units))
    drawn = [
        (unit, drawn_evidence(unit, MANY, pool)) for unit in units if unit.check_flights(MANY.interval).size
    ]
    return [
        *(
            work
            for i in range(PARTS)
            for work in _judged_with(RECORDED, f"without part {i}", folder.plan, *without_part(recorded, i))
        ),
        *_judged_with(
            DRAWN,
            "drawn",
            MANY,
            drawn[FLEET_UNITS : FLEET_UNITS + JUDGED],
            drawn[:FLEET_UNITS],
            drawn[FLEET_UNITS + JUDGED :],
        ),
    ]


def without_part(units: Sequence[T], part: int) -> tuple[list[T], list[T]]:
    """Return the units of one of the `PARTS` of `units`, and the units of all other parts."""
    return list(units[part::PARTS]), [unit for i, unit in enumerate(units) if i % PARTS != part]


def _judged_with(
    level: str,
    fleet: str,
    plan: FleetPlan,
    units: list[tuple[SyntheticUnit, Evidence]],
    others: list[tuple[SyntheticUnit, Evidence]],
    further: list[tuple[SyntheticUnit, Evidence]] | None = None,
) -> list[Work]:
    larger = _fleet([*others, *further])[0] if further else ()
    known = KnownFleet(fleet, *_fleet(others), larger)
    return [
        Work(level, known, plan, unit, evidence) for unit, evidence in units if _is_judged(unit, evidence)
    ]


def _learnt(
    work: list[Work], workers: int | None, on_task: OnTask | None
) -> dict[str, tuple[Prior, Prior | None]]:
    """Return the priors of each fleet in `work`, computed once for all its units because they are slow."""
    first = list({item.fleet.name: item for item in work}.values())
    learnt: dict[str, tuple[Prior, Prior | None]] = {}
    tasks = [Task(i, _priors, (item,), name=f"the fleet {item.fleet.name}") for i, item in enumerate(first)]
    with closing(outcomes(tasks, workers=workers)) as finished:
        for outcome in finished:
            if outcome.failure:
                raise StudyError(outcome.failure)
            learnt[first[outcome.index].fleet.name] = outcome.result
            if on_task:
                on_task(len(learnt), len(tasks))
    return learnt


def _fleet(units: list[tuple[SyntheticUnit, Evidence]]) -> tuple[tuple[Evidence, ...], tuple[float, ...]]:
    lives = tuple(unit.failure for unit, _ in units if unit.failure is not None)
    return tuple(evidence for _, evidence in units), lives


def _is_judged(unit: SyntheticUnit, evidence: Evidence) -> bool:
    return unit.failure is not None and len(evidence.used) >= FEWEST


def _priors(work: Work) -> tuple[Prior, Prior | None]:
    """Return the priors from its fleet, and from the larger fleet if there is one."""
    seed, actuator, fleet = work.plan.seed, work.actuator, work.fleet
    larger = fleet_prior(fleet.larger, seed=seed, actuator=actuator) if fleet.larger else None
    return fleet_prior(fleet.others, seed=seed, actuator=actuator), larger


def _tasks(work: list[Work], priors: Mapping[str, tuple[Prior, Prior | None]]) -> list[Task]:
    """Return a task per unit with the priors of its fleet; without priors, it only identifies its result."""
    code = revision_of(DECIDING, NOT_DECIDING)
    return [
        Task(i, _judge, (item, *priors.get(item.fleet.name, ())), item.key(code), item.unit.serial_number)
        for i, item in enumerate(work)
    ]


def _judge(work: Work, prior: Prior, larger: Prior | None) -> dict[str, Any]:
    case = FailedUnit(work.unit, work.evidence, prior, work.fleet.lives, larger)
    return {
        "level": work.level,
        **judged(case, work.plan, work.actuator, work.plan.seed, tracked=work.level == RECORDED),
    }
