"""Making the prognosis of a unit and keeping it, so that a page shows it without waiting."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from emaphm.history.events import add_events
from emaphm.history.kept_prognosis import KeptPrognosis, keep_prognosis
from emaphm.history.views import keep_curves, read_curves
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.from_fleet.fleet import learnt_prior
from emaphm.prognosis.keeping.curves import Curves, fan_row
from emaphm.prognosis.prognose import DEFAULT_QUESTION, Question, past_lives, prognose

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from emaphm.history import Event, History, Unit
    from emaphm.prognosis.result import Prognosis

ENOUGH = 2
"""Rows of a fan from which on earlier forecasts are not made again: they were kept as they were made."""


@dataclass(frozen=True)
class Updated:
    """A prognosis that was made and kept."""

    prognosis: "Prognosis"
    curves: Curves


def update_prognosis(
    history: "History",
    unit: "Unit",
    question: Question = DEFAULT_QUESTION,
    *,
    seed: int = 0,
    most: int | None = None,
    events: "Callable[[Prognosis], Sequence[Event]]" = lambda _: (),
) -> Updated:
    """Return the prognosis of `unit`, learning from the others of its part number, and keep it.

    It takes about one second for the unit, and 0.5 s for each other unit that is learnt from and that this
    process has not followed yet, with 100 diagnoses each; 1 s more for each that has failed, until another
    fails.

    Parameters
    ----------
    history, unit
        The open history, and a unit of it, `history.unit(serial_number)`.
    question
        The horizon [h], the accepted risk, costs and the stress to come.
    seed
        Source of all randomness.
    most
        Diagnoses that are used at most, of this unit and of each that it learns from, as by `Evidence.of`.
    events
        Returns the events that follow from the prognosis; they are added in the step in which it is kept.

    Raises
    ------
    PrognosisError, MethodError
        As `emaphm.prognosis.prognose`.
    HistoryError
        The database fails.
    """
    basis = history.basis(unit.serial_number)
    evidence = Evidence.of(unit, most)
    prior = learnt_prior(history, unit, seed=seed, most=most)
    prognosis = prognose(evidence, unit.actuator, question, prior=prior, seed=seed)
    curves = Curves.of(prognosis, _earlier(history, unit, prognosis))
    new = events(prognosis)
    with history.writing() as connection:
        keep_prognosis(connection, unit.row, KeptPrognosis.of(basis, prognosis.to_dict()))
        keep_curves(connection, unit.row.id, evidence.hours, basis.diagnoses, curves.to_dict())
        add_events(connection, new)
    return Updated(prognosis, curves)


def _earlier(history: "History", unit: "Unit", prognosis: "Prognosis") -> list[tuple[float, ...]]:
    """Return the rows of a fan before now: those that were kept, else forecasts made again from less.

    Rows that were kept against other requirements are of another life.
    """
    with history.database.reading() as connection:
        kept = read_curves(connection, unit.row.id) or {"fan": []}
    now, labels = prognosis.evidence.hours, [limit.label for limit in prognosis.times.limits]
    rows = [tuple(row) for row in kept["fan"] if row[0] < now]
    # Older versions did not keep the labels.
    if len(rows) >= ENOUGH and kept.get("requirements", labels) == labels:
        return rows
    longest = float(prognosis.paths.hours[-1])
    return [fan_row(hours, sample, longest) for hours, sample in past_lives(prognosis) if hours < now]
