"""Text on the warnings before failures, for the fleet page."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from emaphm.study.fleet.judging import INFORMED, WITH_FLEET
from emaphm.study.fleet.scores import warnings
from emaphm.study.fleet.tracks import HORIZON_H, RISK

WARNING_SHARE = 0.1
"""Required time from the warning to the failure, as a share of life."""

REQUIRED_WARNED = 0.99
"""Required share of the failures with a warning in time."""


def share_in_time(units: Sequence[Mapping[str, Any]], way: str) -> float:
    """Return the share of `units` (results of `judged`) with a warning in time by the method `way`."""
    return float(np.mean(np.array(warnings(units, way)) >= WARNING_SHARE))


def warning_lines(units: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the lines of the page on warnings by our prediction and Bayes' rule, with units warned late."""
    yield (
        f"A warning is given when the probability of failure within {HORIZON_H:g} h exceeds "
        f"{100 * RISK:g} %, which is `--horizon {HORIZON_H:g}` with the default risk. Required: a warning "
        f"at least {100 * WARNING_SHARE:.0f} % of life before the failure, for {100 * REQUIRED_WARNED:.0f} % "
        "of the units.\n"
    )
    for way in (WITH_FLEET, INFORMED):
        low, middle, high = np.quantile(warnings(units, way), (0.05, 0.5, 0.95))
        share = share_in_time(units, way)
        yield (
            f"- *{way}*: {round(share * len(units))} of {len(units)} units have a warning in time "
            f"({100 * share:.1f} %); at the first warning {100 * middle:.0f} % of life remain "
            f"(median; 5 to 95 %: {100 * low:.0f} to {100 * high:.0f} %)."
        )
    ours, bayes = (warnings(units, way) for way in (WITH_FLEET, INFORMED))
    for unit, remaining, by_bayes in zip(units, ours, bayes, strict=True):
        if remaining < WARNING_SHARE:
            yield (
                f"- {unit['unit']} fails by {unit['failed']} ({unit['law']}) after {unit['failure']:,.0f} h. "
                f"{100 * remaining:.1f} % of its life remain at our first warning, {100 * by_bayes:.1f} % at "
                "the first warning by Bayes' rule."
            )
