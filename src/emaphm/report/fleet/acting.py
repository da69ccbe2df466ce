"""Text and tables on removals by predictions, and on predictions over whole lives, for the fleet page."""

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


def acting_lines(units: Units, interval: float) -> Iterator[str]:
    """Yield the lines of the page on the outcome of each prediction method with each rule of removal.

    Check flights are `interval` hours [h] apart.
    """
    failure_cost = COSTS.failure / COSTS.replacement
    yield (
        f"A planner decides on each unit at its check flights, each {interval:g} h. The unit is removed if "
        "the advice of `emaphm prognose` does not allow it to fly until the next check flight, with either "
        '"inspect by" or "replace before". *Cost* is per 1,000 flight hours, with 1 for a planned '
        f"replacement and {failure_cost:g} for a failure in service. *Of life wasted*: mean over the units "
        f"of the remaining life at the removal. *Unneeded removals*: removals with more than {HORIZON_H:g} h "
        "of true RUL, per 1,000 flight hours. *Lives of the fleet*: no diagnosis; the hours at which other "
        "units failed, as for a replacement by hours flown.\n"
    )
    yield (
        f"*By the risk*: removal before the probability of failure exceeds {100 * RISK:g} %, the advice "
        "without costs. *By the costs*: removal at the least cost per hour (`--failure-cost "
        f'{COSTS.failure:g} --replacement-cost {COSTS.replacement:g}`). *Inspections aside*: only "replace '
        'before" removes a unit; a unit with "inspect by" flies until the next check flight, with more risk '
        "than allowed, because the fleet has no inspections in between.\n"
    )
    for rule in RULES:
        yield f"Removed by {rule}, {len(units)} synthetic units:\n"
        yield markdown_table(ACTING_HEADER, acted_rows(units, rule))
        yield ""


def over_life_lines(units: Units) -> Iterator[str]:
    """Yield the lines of the page on the scores of each prediction method over all check flights."""
    yield (
        "At all check flights of each unit: the Brier score of the probability of failure within "
        f"{HORIZON_H:g} h; the share of late predictions; the prognostic horizon (half of the probability "
        "within 20 % of the life around the true RUL), as a share of life; and the mean relative accuracy "
        "over a life, of which the median unit's is given ([definitions](prognosis.md#metrics)).\n"
    )
    yield markdown_table(OVER_LIFE_HEADER, over_life_rows(units))
