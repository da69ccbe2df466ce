"""What other units of the same part number teach about a new one: laws, life scales and rates."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.evidence import Evidence, follow
from emaphm.prognosis.prior import Hypotheses, Prior, is_moving, rate_when_new
from emaphm.prognosis.resampling import drawn_rows, recombined
from emaphm.prognosis.settings import FILTER
from emaphm.prognosis.stress import StressReference
from emaphm.random_streams import stream

if TYPE_CHECKING:
    from emaphm.history import History, Unit

MOST_UNITS = 30
"""Units that are followed; those with most explained diagnoses are taken."""

FOLLOWED_BY = replace(FILTER, particles=300)
"""Their filter: a third of a prognosis's particles, since its draws are pooled; 2 ms a diagnosis."""

WEIGHT_OF_GENERAL = 2.0
"""Units that the general prior counts as: with two of a fleet, half of what is expected is the fleet's."""

FEWEST_DIAGNOSES = 3
"""Explained diagnoses of a unit below which it teaches nothing that was not put in."""

SPREAD = 0.3
"""Standard deviation of a new unit's rate about that of another unit, as a share of it."""

DRAWN = 200
"""Particles that each unit gives."""


def fellows(history: "History", unit: "Unit") -> list[Evidence]:
    """Return what a history says of the other units of the part number that teach most.

    Those with most explained diagnoses, `MOST_UNITS` at most; `HistoryError` where the database fails.
    """
    others = [
        one
        for one in history.overviews(unit.part_number)
        if one.explained >= FEWEST_DIAGNOSES and one.unit.serial_number != unit.serial_number
    ]
    others.sort(key=lambda one: (-one.explained, one.unit.serial_number))
    return [Evidence.of(history.unit(one.unit.serial_number)) for one in others[:MOST_UNITS]]


def fleet_prior(others: Sequence[Evidence], prior: Prior | None = None, *, seed: int = 0) -> Prior:
    """Return the prior of a new unit, given the `others` of its part number.

    Each of the others is followed from the general prior; draws from what is then believed of it, all units
    alike, are what the new unit may be: its hypothesis is one of theirs with probability n / (n + 2), n being
    their number, else of the general prior. A rate is taken back to the new component's by its law. This is
    an empirical Bayes estimate of the distribution over units, which is wider than it by each unit's own
    uncertainty.

    Errors as in `follow`.
    """
    general = prior or Prior()
    chosen = [one for one in others if len(one.used) >= FEWEST_DIAGNOSES]
    chosen = sorted(chosen, key=lambda one: (-len(one.used), one.unit))[:MOST_UNITS]
    if not chosen:
        return general
    reference = general.reference or StressReference.of([piece for one in chosen for piece in one.stresses])
    general = replace(general, reference=reference)
    return pooled([learnt(one, general, seed) for one in chosen], general)


def pooled(parts: Sequence[Hypotheses], general: Prior) -> Prior:
    """Return the prior that several units teach together: each its `learnt` hypotheses, one or more."""
    hypotheses = Hypotheses(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    share = len(parts) / (len(parts) + WEIGHT_OF_GENERAL)
    return replace(general, fleet=hypotheses, fleet_share=share, units=len(parts))


def learnt(evidence: Evidence, general: Prior, seed: int) -> Hypotheses:
    """Return hypotheses of a new unit as one unit teaches them, each array (DRAWN, 8)."""
    belief = follow(evidence, general, seed=seed, settings=FOLLOWED_BY).belief
    rows = drawn_rows(belief, DRAWN, stream(seed, "fleet's prior", evidence.unit))
    units = recombined(belief, rows)
    held = units.hypotheses()
    factor = rate_when_new(held, units.aged, general.settings)
    rate = np.where(is_moving(held.law), held.rate / factor, 0.0)
    deviation = np.hypot(held.rate_deviation / factor, SPREAD * np.abs(rate))
    return held._replace(rate=rate, rate_deviation=np.where(is_moving(held.law), deviation, 0.0))
