"""What the page of the synthetic fleet says of acting on predictions, and of predictions over whole lives."""

from collections.abc import Iterator

from emaphm.study.fleet.acting import (
    ACTING_HEADER,
    OVER_LIFE_HEADER,
    Units,
    acted_rows,
    over_life_rows,
)
from emaphm.study.fleet.tracks import COSTS, HORIZON_H, RISK, RULES
from emaphm.text_table import markdown_table


def said_of_acting(units: Units, interval: float) -> Iterator[str]:
    """Yield the lines of the page: what each way of predicting comes to by each rule of removal.

    Check flights are `interval` hours [h] apart.
    """
    dear = COSTS.failure / COSTS.replacement
    yield (
        f"A planner sees each unit at its check flights, each {interval:g} h, and removes it where the "
        "advice of `emaphm prognose` does not allow it to fly until the next one, be it "
        '"inspect by" or "replace before". *Cost* is per 1,000 flight hours, a planned replacement being 1 '
        f"and a failure in service {dear:g}. *Of life wasted*: mean over the units of what is left at the "
        f"removal. *Unneeded removals*: with more than {HORIZON_H:g} h of true RUL, per 1,000 flight hours. "
        "*Lives of the fleet*: no diagnosis at all, the hours at which other units failed, as for a "
        "replacement by hours flown.\n"
    )
    yield (
        f"*By the risk*: before the probability of failure exceeds {100 * RISK:g} %, the advice without "
        f"costs. *By the costs*: where that is cheapest by the hour (`--failure-cost {COSTS.failure:g} "
        f'--replacement-cost {COSTS.replacement:g}`). *Inspections aside*: only "replace before" removes a '
        'unit; one to "inspect by" then flies until the next check flight, with more risk than allowed, as '
        "the fleet has no inspections in between.\n"
    )
    for rule in RULES:
        yield f"Removed by {rule}, {len(units)} synthetic units:\n"
        yield markdown_table(ACTING_HEADER, acted_rows(units, rule))
        yield ""


def said_over_life(units: Units) -> Iterator[str]:
    """Yield the lines of the page: scores of each way over all check flights."""
    yield (
        "At all check flights of each unit: the Brier score of the probability of failure within "
        f"{HORIZON_H:g} h; the share of late predictions; the prognostic horizon (half of the probability "
        "within 20 % of the life around the true RUL), as a share of life; and the mean relative accuracy "
        "over a life, of which the median unit's is given ([definitions](prognosis.md#metrics)).\n"
    )
    yield markdown_table(OVER_LIFE_HEADER, over_life_rows(units))
