"""Running the study: a synthetic fleet through the whole chain, then predictions judged unit by unit."""

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
"""Of the recorded level: all but one or two units fail within 7,000 h."""

MANY = FleetPlan(units=140, flights=70, interval=100.0, seed=2)
"""Of the level with drawn diagnoses."""

PARTS = 13
"""Of the recorded level, each judged with the other parts for its fleet: 96 of 104 units."""

RESULTS = "results.sqlite"

RECORDED, DRAWN = "recorded", "drawn"
"""Levels of the study: diagnoses of recordings; diagnoses drawn from the covariances of these."""

FLEET_UNITS, JUDGED = 30, 40
"""The first units of that level, which are the fleet of those after them, and how many are judged. All others
are in the larger fleet, with the first ones."""

FEWEST = 4
"""Explained diagnoses of a unit that is judged: what failed before cannot be seen to come by anybody."""

DECIDING = ("prognosis", "fleet/synthetic", "study/fleet", "actuator", "quantiles.py", "random_streams.py")
"""Code that decides what is judged, given the evidence: what reads the history decides that."""

NOT_DECIDING = (
    "actuator/toml",
    "study/fleet/__main__.py",
    "study/fleet/scores.py",
    "study/fleet/acting.py",
)

T = TypeVar("T")


@dataclass(frozen=True)
class StudyFolder:
    """The folder of the study: the fleet with its recordings in ``fleet``, what was judged next to it.

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
        """What was judged."""
        return ResultStore(self.path / RESULTS)


def run(
    folder: StudyFolder,
    *,
    workers: int | None = None,
    on_step: Callable[[str], OnTask | None] = lambda _: None,
) -> None:
    """Do what is missing of both levels.

    Raises
    ------
    StudyError
        Some units could not be judged; the others are kept.
    ExecutionError, HistoryError, OutputError
        Workers, the folder or the history cannot be used.
    """
    make_folder(folder.path)
    run_chain(Chain(folder.plan, folder.fleet, workers=workers, on_step=on_step))
    work = _work(folder)
    done = folder.results.finished(_tasks(work, {}))
    missing = [one for i, one in enumerate(work) if i not in done]
    chosen = _tasks(work, _learnt(missing, workers, on_step("learning from fleets")))
    failures = run_tasks(chosen, folder.results, workers=workers, on_task=on_step("judging"))
    if failures:
        raise StudyError(f"{len(failures)} of {len(chosen)} units failed, the first: {failures[0]}")


def results(folder: StudyFolder) -> dict[str, list[dict[str, Any]]]:
    """Return what was judged of each level, unit by unit; errors as in `run`."""
    work = _work(folder)
    done, _ = folder.results.read(_tasks(work, {}))
    found: dict[str, list[dict[str, Any]]] = {RECORDED: [], DRAWN: []}
    for i, outcome in sorted(done.items()):
        found[work[i].level].append(outcome.result)
    return found


def recorded_fleet(folder: StudyFolder) -> list[tuple[SyntheticUnit, Evidence]]:
    """Return the units of the recorded level with their diagnoses."""
    with History.open(folder.fleet.history) as history:
        units = [drawn_unit(folder.plan, i) for i in range(folder.units)]
        return [(one, Evidence.of(history.unit(one.serial_number))) for one in units]


@dataclass(frozen=True, eq=False)
class KnownFleet:
    """What units are predicted from: others, with their hours of failure [h], and a larger fleet or none."""

    name: str
    others: tuple[Evidence, ...]
    lives: tuple[float, ...]
    larger: tuple[Evidence, ...] = ()

    @cached_property
    def digest(self) -> str:
        """What identifies all of it."""
        known = [[fingerprint(one) for one in units] for units in (self.others, self.larger)]
        return hashlib.sha256(json.dumps([known, self.lives]).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class Work:
    """A unit that failed, to be judged: its diagnoses, and the fleet that it is predicted from."""

    level: str
    fleet: KnownFleet
    plan: FleetPlan
    unit: SyntheticUnit
    evidence: Evidence

    @property
    def actuator(self) -> Actuator:
        """The fleet's, with its requirements."""
        return fleet_actuator(self.plan.drawn_from)

    def key(self, code: str) -> str:
        """Return what identifies the result: all that decides it. Plan and name say what the unit is."""
        about = [self.level, self.plan.to_dict(), self.unit.serial_number, fingerprint(self.evidence)]
        about += [self.fleet.digest, self.actuator.model_dump(mode="json"), code]
        return hashlib.sha256(json.dumps(about).encode()).hexdigest()


def _work(folder: StudyFolder) -> list[Work]:
    recorded = recorded_fleet(folder)
    pool = DiagnosisPool.of([evidence for _, evidence in recorded])
    units = (drawn_unit(MANY, i) for i in range(MANY.units))
    drawn = [(one, drawn_evidence(one, MANY, pool)) for one in units if one.check_flights(MANY.interval).size]
    return [
        *(
            one
            for i in range(PARTS)
            for one in _judged_with(RECORDED, f"without part {i}", folder.plan, *without_part(recorded, i))
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
    """Return one of the `PARTS` of `units`, and those of all other parts."""
    return list(units[part::PARTS]), [one for i, one in enumerate(units) if i % PARTS != part]


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
    """Return the priors of each fleet in `work`, once for all its units: they take longest."""
    first = list({one.fleet.name: one for one in work}.values())
    learnt: dict[str, tuple[Prior, Prior | None]] = {}
    tasks = [Task(i, _priors, (one,), name=f"the fleet {one.fleet.name}") for i, one in enumerate(first)]
    with closing(outcomes(tasks, workers=workers)) as finished:
        for outcome in finished:
            if outcome.failure:
                raise StudyError(outcome.failure)
            learnt[first[outcome.index].fleet.name] = outcome.result
            if on_task:
                on_task(len(learnt), len(tasks))
    return learnt


def _fleet(units: list[tuple[SyntheticUnit, Evidence]]) -> tuple[tuple[Evidence, ...], tuple[float, ...]]:
    lives = tuple(one.failure for one, _ in units if one.failure is not None)
    return tuple(evidence for _, evidence in units), lives


def _is_judged(unit: SyntheticUnit, evidence: Evidence) -> bool:
    return unit.failure is not None and len(evidence.used) >= FEWEST


def _priors(work: Work) -> tuple[Prior, Prior | None]:
    """Return the priors of its fleet, and of the larger one."""
    seed, actuator, fleet = work.plan.seed, work.actuator, work.fleet
    larger = fleet_prior(fleet.larger, seed=seed, actuator=actuator) if fleet.larger else None
    return fleet_prior(fleet.others, seed=seed, actuator=actuator), larger


def _tasks(work: list[Work], priors: Mapping[str, tuple[Prior, Prior | None]]) -> list[Task]:
    """Return a task for each unit, with the priors of its fleet; without, it only names its result."""
    code = revision_of(DECIDING, NOT_DECIDING)
    return [
        Task(i, _judge, (one, *priors.get(one.fleet.name, ())), one.key(code), one.unit.serial_number)
        for i, one in enumerate(work)
    ]


def _judge(work: Work, prior: Prior, larger: Prior | None) -> dict[str, Any]:
    case = FailedUnit(work.unit, work.evidence, prior, work.fleet.lives, larger)
    return {
        "level": work.level,
        **judged(case, work.plan, work.actuator, work.plan.seed, tracked=work.level == RECORDED),
    }
