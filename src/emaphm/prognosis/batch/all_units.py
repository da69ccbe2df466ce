"""The prognosis of each unit of a history: the hypotheses of its fleet are made once, then unit by unit."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from emaphm.errors import ExecutionError
from emaphm.execution import OnTask, Task, check_workers, in_order, outcomes
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.from_fleet.fleet import Fleet
from emaphm.prognosis.from_fleet.learning import UnitHypotheses, hypotheses_of_unit
from emaphm.prognosis.keeping.curves import Curves
from emaphm.prognosis.prognose import DEFAULT_QUESTION, Question, prognose

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.history import KeptPrognosis
    from emaphm.history.basis import Basis

AT_ONCE = 5
"""Units of a task: the hypotheses of a fleet, some megabytes, go to a worker once for all of them, and the
last worker does not keep the others waiting for long."""


@dataclass(frozen=True)
class UnitOutcome:
    """A unit's prognosis as `emaphm prognose --json` prints it, or the text of the error that it ended in.

    `basis` is what it was made from, `curves` are those of its figures, without forecasts from earlier.
    """

    unit: str
    values: Mapping[str, Any]
    basis: "Basis | None" = None
    error: str = ""
    curves: Curves | None = None

    def kept(self) -> "KeptPrognosis":
        """Return the prognosis as a history keeps it."""
        from emaphm.history import KeptPrognosis

        assert self.basis is not None  # noqa: S101 - one that has failed is not kept
        return KeptPrognosis.of(self.basis, self.values)


def prognose_all(
    where: str | Path,
    question: Question = DEFAULT_QUESTION,
    *,
    part_number: str | None = None,
    actuator: "Actuator | None" = None,
    fleet: bool = True,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    on_unit: OnTask | None = None,
) -> Generator[UnitOutcome]:
    """Yield the prognosis of each unit, by part and serial number, as tasks on many workers finish.

    Each is what `prognose` gives with the unit's `learnt_prior`, whatever the number of workers. A unit that
    cannot be prognosed has an outcome with an error.

    Parameters
    ----------
    where
        Of the history: a file, or postgresql://…; each worker opens it.
    question
        The same of all: the horizon [h], the accepted risk, costs and the stress to come.
    part_number
        Only its units.
    actuator
        With the requirements; that of each unit's last diagnosis where left out.
    fleet
        Whether each learns from the others of its part number; else all have the general prior.
    seed
        Source of all randomness.
    workers, scheduler
        Processes on this machine, one a core where left out; or the address of a Dask scheduler.
    on_unit
        Called as units are done: how many, of how many.

    Raises
    ------
    HistoryError
        The history cannot be read, has no unit of the part number, or one that `actuator` does not describe.
    ExecutionError
        The workers or the scheduler cannot be used.
    """
    from emaphm.history import History

    check_workers(scheduler)
    place = str(Path(where).absolute()) if "://" not in str(where) else str(where)
    fleets: dict[str, Fleet] = {}
    with History.open(where) as history:
        history.check_part_number(part_number)
        lines = history.states(part_number)
        parts = sorted({one.part_number for one in lines})
        if actuator is not None:
            for one in lines:
                history.unit(one.serial_number).described_by(actuator)
        for part in parts if fleet else ():
            of_part = [one for one in lines if one.part_number == part]
            fleets[part] = Fleet.read(history, of_part, seed)
    fleets = {part: _with_hypotheses(one, workers, scheduler) for part, one in fleets.items()}
    tasks: list[Task] = []
    for part in parts:
        names = [one.serial_number for one in lines if one.part_number == part]
        for i in range(0, len(names), AT_ONCE):
            chosen = tuple(names[i : i + AT_ONCE])
            arguments = (place, chosen, question, actuator, fleets.get(part), seed)
            tasks.append(Task(len(tasks), _prognoses, arguments, name=f"units '{chosen[0]}' and following"))
    done = 0
    if on_unit:
        on_unit(0, len(lines))
    with closing(outcomes(tasks, workers=workers, scheduler=scheduler)) as arriving:
        for task, outcome in in_order(tasks, arriving):
            names = task.arguments[1]
            done += len(names)
            if on_unit:
                on_unit(done, len(lines))
            if outcome.failure:
                yield from (UnitOutcome(name, {}, error=outcome.failure) for name in names)
            else:
                yield from outcome.result


def _with_hypotheses(fleet: Fleet, workers: int | None, scheduler: str | None) -> Fleet:
    """Return a fleet with the hypotheses of its units, computed by the workers."""
    tasks = [
        Task(i, hypotheses_of_unit, (one, fleet.general, fleet.seed), name=one.unit)
        for i, one in enumerate(fleet.followed)
    ]
    found: dict[str, UnitHypotheses] = {}
    with closing(outcomes(tasks, workers=workers, scheduler=scheduler)) as arriving:
        for task, outcome in in_order(tasks, arriving):
            if outcome.failure:
                raise ExecutionError(
                    f"the prior from the fleet cannot be computed: {outcome.failure}; give --no-fleet for "
                    "each unit alone"
                )
            found[task.name] = outcome.result
    return replace(fleet, hypotheses=found)


def _prognoses(
    where: str,
    names: Sequence[str],
    question: Question,
    actuator: "Actuator | None",
    fleet: Fleet | None,
    seed: int,
) -> list[UnitOutcome]:
    """Return the prognoses of some units; a task."""
    from emaphm.errors import EmaphmError
    from emaphm.history import History

    results = []
    with History.open(where) as history:
        for name in names:
            try:
                unit, basis = history.unit(name), history.basis(name)
                evidence = Evidence.of(unit)
                described = unit.described_by(actuator)
                prior = None if fleet is None else fleet.prior_of(name, described)
                made = prognose(evidence, described, question, prior=prior, seed=seed, keep_past=False)
            except EmaphmError as error:
                results.append(UnitOutcome(name, {}, error=str(error)))
            else:
                results.append(UnitOutcome(name, made.to_dict(), basis, curves=Curves.of(made)))
    return results
