"""Making the prognosis of a unit and keeping it, so that a page shows it without waiting."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from emaphm.history.kept_prognosis import KeptPrognosis, keep_prognosis
from emaphm.history.views import keep_curves, read_curves
from emaphm.prognosis.evidence import Evidence
from emaphm.prognosis.from_fleet.learning import learnt_prior
from emaphm.prognosis.keeping.curves import Curves, fan_row
from emaphm.prognosis.prognose import DEFAULT_QUESTION, Question, past_lives, prognose

if TYPE_CHECKING:
    from emaphm.history import History, Unit
    from emaphm.history.views import UnitState
    from emaphm.prognosis.result import Prognosis

ENOUGH = 2
"""Rows of a fan from which on earlier forecasts are not made again: they were kept as they were made."""


@dataclass(frozen=True)
class Updated:
    """A prognosis that was made and kept."""

    prognosis: "Prognosis"
    curves: Curves


def update_prognosis(
    history: "History", unit: "Unit", question: Question = DEFAULT_QUESTION, *, seed: int = 0
) -> Updated:
    """Return the prognosis of `unit`, learning from the others of its part number, and keep it.

    It takes about one second for the unit, and 0.2 s for each other unit that is learnt from and that this
    process has not followed yet.

    Errors as in `emaphm.prognosis.prognose`; `HistoryError` where the database fails.
    """
    evidence = Evidence.of(unit)
    prior = learnt_prior(history, unit, seed=seed)
    prognosis = prognose(evidence, unit.actuator, question, prior=prior, seed=seed)
    curves = Curves.of(prognosis, _earlier(history, unit, prognosis))
    count = len(evidence.observations)
    with history.database.writing() as connection:
        keep_prognosis(connection, unit.row, KeptPrognosis(evidence.hours, count, prognosis.to_dict()))
        keep_curves(connection, unit.row.id, evidence.hours, count, curves.to_dict())
    return Updated(prognosis, curves)


def is_current(state: "UnitState", prognosis: KeptPrognosis | None) -> bool:
    """Return whether nothing was added to a unit since its `prognosis` was made."""
    if prognosis is None:
        return False
    return prognosis.diagnoses >= state.recordings and prognosis.at >= state.changed


def _earlier(history: "History", unit: "Unit", prognosis: "Prognosis") -> list[tuple[float, ...]]:
    """Return the rows of a fan before now: those that were kept, else forecasts made again from less."""
    with history.database.reading() as connection:
        kept = read_curves(connection, unit.row.id)
    now = prognosis.evidence.hours
    rows = [tuple(row) for row in kept["fan"] if row[0] < now] if kept else []
    if len(rows) >= ENOUGH:
        return rows
    longest = float(prognosis.paths.hours[-1])
    return [fan_row(hours, sample, longest) for hours, sample in past_lives(prognosis) if hours < now]
