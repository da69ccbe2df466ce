"""Numbers of outcomes by class of spoilt recordings."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

from emaphm.study.spoilt.judging import OUTCOMES, UNDETECTED_ERROR
from emaphm.study.spoilt.run import SpoiltCase, class_of

Results = Mapping[SpoiltCase, Mapping[str, Any]]


def counts(results: Results) -> dict[str, Counter[str]]:
    """Return the number of cases by class and outcome, in the order of the classes."""
    by_class: dict[str, Counter[str]] = {}
    for case, result in results.items():
        by_class.setdefault(case.spoilt_class, Counter())[result["outcome"]] += 1
    return by_class


def rows(results: Results) -> list[tuple[str, ...]]:
    """Return a row of text per class: name, number of cases, numbers of outcomes; the last is the total."""
    by_class = counts(results)
    total = Counter(result["outcome"] for case, result in results.items() if not class_of(case).control)
    table = [_row(name, tally) for name, tally in by_class.items()]
    return [*table, _row("all but the control", total)]


def _row(name: str, tally: Counter[str]) -> tuple[str, ...]:
    return (name, str(tally.total()), *(str(tally[outcome] or "") for outcome in OUTCOMES))


def undetected_errors(results: Results) -> list[tuple[SpoiltCase, Mapping[str, Any]]]:
    """Return the cases with an undetected error, with their results."""
    return [(case, result) for case, result in results.items() if result["outcome"] == UNDETECTED_ERROR]
