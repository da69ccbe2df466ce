"""Prognoses of all units of a history: hypotheses of the fleet once, then one prognosis per unit."""

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
"""Units per task: the hypotheses of a fleet, some megabytes, are sent to a worker once per task, and the
other workers do not wait long for the last task."""


@dataclass(frozen=True)
class UnitOutcome:
    """A unit's prognosis as printed by `emaphm prognose --json`, or the text of its error.

    `basis` identifies the entries it was computed from, `curves` are those of its figures, without earlier
    forecasts.
    """

    unit: str
    values: Mapping[str, Any]
    basis: "Basis | None" = None
    error: str = ""
    curves: Curves | None = None

    def kept(self) -> "KeptPrognosis":
        """Return the prognosis in the form stored in a history."""
        from emaphm.history import KeptPrognosis

        assert self.basis is not None  # noqa: S101 - an outcome with an error is not kept
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
    """Yield the prognosis of each unit, by part and serial number, as tasks on several workers finish.

    Each prognosis is that of `prognose` with the unit's `learnt_prior`, for any number of workers. A unit
    that cannot be prognosed has an outcome with an error.

    Parameters
    ----------
    where
        Address of the history: a file, or postgresql://…; each worker opens it.
    question
        Horizon [h], accepted risk, costs and future stress, the same for all units.
    part_number
        Part number of the units; by default all units.
    actuator
        Actuator with the requirements; by default that of each unit's last diagnosis.
    fleet
        Whether priors are learnt from other units of the part number; otherwise all have the general prior.
    seed
        Seed of the random streams.
    workers, scheduler
        Number of processes on this machine, by default one per core; or the address of a Dask scheduler.
    on_unit
        Called as units are finished, with the number of finished units and of all units.

    Raises
    ------
    HistoryError
        The history cannot be read, has no unit of the part number, or a unit that `actuator` does not
        describe.
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
        parts = sorted({unit_state.part_number for unit_state in lines})
        if actuator is not None:
            for unit_state in lines:
                history.unit(unit_state.serial_number).described_by(actuator)
        for part in parts if fleet else ():
            of_part = [unit_state for unit_state in lines if unit_state.part_number == part]
            fleets[part] = Fleet.read(history, of_part, seed)
    fleets = {part: _with_hypotheses(part_fleet, workers, scheduler) for part, part_fleet in fleets.items()}
    tasks: list[Task] = []
    for part in parts:
        names = [unit_state.serial_number for unit_state in lines if unit_state.part_number == part]
        for i in range(0, len(names), AT_ONCE):
            chosen = tuple(names[i : i + AT_ONCE])
            arguments = (place, chosen, question, actuator, fleets.get(part), seed)
            tasks.append(Task(len(tasks), _prognoses, arguments, name=f"units '{chosen[0]}' and following"))
    finished = 0
    if on_unit:
        on_unit(0, len(lines))
    with closing(outcomes(tasks, workers=workers, scheduler=scheduler)) as arriving:
        for task, outcome in in_order(tasks, arriving):
            names = task.arguments[1]
            finished += len(names)
            if on_unit:
                on_unit(finished, len(lines))
            if outcome.failure:
                yield from (UnitOutcome(name, {}, error=outcome.failure) for name in names)
            else:
                yield from outcome.result


def _with_hypotheses(fleet: Fleet, workers: int | None, scheduler: str | None) -> Fleet:
    """Return a fleet with the hypotheses of its units, computed by the workers."""
    tasks = [
        Task(i, hypotheses_of_unit, (unit, fleet.general, fleet.seed), name=unit.unit)
        for i, unit in enumerate(fleet.followed)
    ]
    hypotheses: dict[str, UnitHypotheses] = {}
    with closing(outcomes(tasks, workers=workers, scheduler=scheduler)) as arriving:
        for task, outcome in in_order(tasks, arriving):
            if outcome.failure:
                raise ExecutionError(
                    f"the prior from the fleet cannot be computed: {outcome.failure}; give --no-fleet to "
                    "use the general prior"
                )
            hypotheses[task.name] = outcome.result
    return replace(fleet, hypotheses=hypotheses)


def _prognoses(
    where: str,
    names: Sequence[str],
    question: Question,
    actuator: "Actuator | None",
    fleet: Fleet | None,
    seed: int,
) -> list[UnitOutcome]:
    """Return the prognoses of some units, as one task."""
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
                prognosis = prognose(evidence, described, question, prior=prior, seed=seed, keep_past=False)
            except EmaphmError as error:
                results.append(UnitOutcome(name, {}, error=str(error)))
            else:
                results.append(UnitOutcome(name, prognosis.to_dict(), basis, curves=Curves.of(prognosis)))
    return results
