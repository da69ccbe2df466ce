"""Computation and storage of the prognosis of a unit, so that a page can show it without delay."""

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from emaphm.history import reading
from emaphm.history.events import add_events
from emaphm.history.kept_prognosis import KeptPrognosis, keep_prognosis
from emaphm.history.views import read_curves
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.from_fleet.fleet import learnt_prior
from emaphm.prognosis.keeping.curves import Curves, fan_row
from emaphm.prognosis.prognose import DEFAULT_QUESTION, Question, past_rul_forecasts, prognose

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from emaphm.history import Event, History, Unit
    from emaphm.prognosis.result import Prognosis

ENOUGH = 2
"""Number of stored rows of a fan from which on earlier forecasts are not recomputed."""


def update_prognosis(
    history: "History",
    unit: "Unit",
    question: Question = DEFAULT_QUESTION,
    *,
    seed: int = 0,
    most: int | None = None,
    events: "Callable[[Prognosis], Sequence[Event]]" = lambda _: (),
) -> Curves:
    """Compute and store the prognosis of `unit`, with a prior from other units of its part number.

    Return its stored curves, with the fan of earlier forecasts.

    With 100 diagnoses for each unit, it takes about one second for the unit, and 0.5 s for each other unit of
    the prior that this process has not filtered yet; 1 s more for each failed unit, until another unit fails.

    Parameters
    ----------
    history, unit
        The open history, and a unit of it, `history.unit(serial_number)`.
    question
        The horizon [h], the accepted risk, costs and the future stress.
    seed
        Seed of the random streams.
    most
        Largest number of diagnoses used, of this unit and of each other unit, as in `Evidence.of`.
    events
        Returns the events that follow from the prognosis; they are added in the same transaction.

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
    return keep_with_curves(history, unit, kept, curves, earlier, new)


def keep_with_curves(
    history: "History",
    unit: "Unit",
    prognosis: KeptPrognosis,
    curves: Curves,
    earlier: "Callable[[], list[tuple[float, ...]]]" = list,
    events: "Sequence[Event]" = (),
) -> Curves:
    """Store a prognosis of `unit` with curves and events in one transaction; return the stored curves.

    Parameters
    ----------
    curves
        Curves of the prognosis, with only its own row of the fan.
    earlier
        Returns earlier rows of the fan, as `earlier_rows`; it is called only if too few rows were stored with
        earlier prognoses. Stored rows for other requirements are not used.

    Raises
    ------
    HistoryError
        The database fails, or the unit was withdrawn meanwhile.
    """
    with history.database.reading() as connection:
        # Read again, here and below: after a withdrawal, its id may be that of another unit.
        row = reading.unit(connection, unit.serial_number)
        stored = read_curves(connection, row.id) or {"fan": []}
    rows = [tuple(row) for row in stored["fan"] if row[0] < curves.now]
    # Older versions did not keep the labels.
    has_same_requirements = stored.get("requirements", list(curves.requirements)) == list(curves.requirements)
    if len(rows) < ENOUGH or not has_same_requirements:
        rows = earlier()
    curves_with_fan = replace(curves, fan=(*rows, *curves.fan))
    with history.writing() as connection:
        row = reading.unit(connection, unit.serial_number)
        keep_prognosis(connection, row, prognosis, curves_with_fan.to_dict())
        add_events(connection, events)
    return curves_with_fan


def earlier_rows(prognosis: "Prognosis") -> list[tuple[float, ...]]:
    """Return earlier rows of a fan: forecasts recomputed from the kept earlier filter states."""
    now, longest = prognosis.evidence.hours, float(prognosis.paths.hours[-1])
    return [fan_row(hours, sample, longest) for hours, sample in past_rul_forecasts(prognosis) if hours < now]
