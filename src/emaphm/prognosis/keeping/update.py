"""Making the prognosis of a unit and keeping it, so that a page shows it without waiting."""

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from emaphm.history.events import add_events
from emaphm.history.kept_prognosis import KeptPrognosis, keep_prognosis
from emaphm.history.views import read_curves
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
    kept = KeptPrognosis.of(basis, prognosis.to_dict())
    curves = Curves.of(prognosis)
    earlier, new = partial(earlier_rows, prognosis), events(prognosis)
    return Updated(prognosis, keep_with_curves(history, unit, kept, curves, earlier, new))


def keep_with_curves(
    history: "History",
    unit: "Unit",
    prognosis: KeptPrognosis,
    curves: Curves,
    earlier: "Callable[[], list[tuple[float, ...]]]" = list,
    events: "Sequence[Event]" = (),
) -> Curves:
    """Keep a prognosis of `unit` with its curves, and add events, in one step; return the curves as kept.

    Parameters
    ----------
    curves
        Of the prognosis, with its own row of the fan alone.
    earlier
        Returns rows of the fan before it, as `earlier_rows`; it is asked only where too few were kept with
        the prognoses before. Rows that were kept against other requirements are of another life.

    Raises
    ------
    HistoryError
        The database fails.
    """
    with history.database.reading() as connection:
        before = read_curves(connection, unit.row.id) or {"fan": []}
    rows = [tuple(row) for row in before["fan"] if row[0] < curves.now]
    # Older versions did not keep the labels.
    is_same_life = before.get("requirements", list(curves.requirements)) == list(curves.requirements)
    if len(rows) < ENOUGH or not is_same_life:
        rows = earlier()
    whole = replace(curves, fan=(*rows, *curves.fan))
    with history.writing() as connection:
        keep_prognosis(connection, unit.row, prognosis, whole.to_dict())
        add_events(connection, events)
    return whole


def earlier_rows(prognosis: "Prognosis") -> list[tuple[float, ...]]:
    """Return rows of a fan before a prognosis: forecasts made again from less, where beliefs were kept."""
    now, longest = prognosis.evidence.hours, float(prognosis.paths.hours[-1])
    return [fan_row(hours, sample, longest) for hours, sample in past_lives(prognosis) if hours < now]
