"""Residuals of two estimates compared: their ratio, notes on equal ones, and when a search is stopped."""

from collections.abc import Callable

import numpy as np

from emaphm.actuator.laws import LAWS
from emaphm.diagnosis.selection.settings import LAW_SELECTION, SELECTION
from emaphm.estimation.correction_iterations import never
from emaphm.estimation.search_result import SearchResult


def share_of_residual(tried: SearchResult, before: SearchResult) -> float:
    """Return the mean squared residual of the channels in `tried`, relative to that in `before`."""
    rows = before.objective.channel_rows
    ratios = before.objective.problem.weights / tried.objective.problem.weights
    residual = tried.residual[:rows] * np.repeat(ratios, before.objective.problem.samples)
    return before.objective.mean_square(residual) / before.objective.mean_square(before.residual[:rows])


def is_residual_above(tried: SearchResult, before: SearchResult, share: float) -> bool:
    """Return whether the residual of `tried` is more than a `share` of the residual of `before`.

    This must hold both for the mean squared residual of all channels, and for that of the primary channel
    beyond noise and switching.
    """
    excess, excess_before = (estimate.normalised_residual**2 - 1 for estimate in (tried, before))
    return excess > share * excess_before and share_of_residual(tried, before) > share


def notes_on_alternatives(result: SearchResult) -> tuple[str, ...]:
    """Return a note on laws, or parameters, with which alternatives explain the recording equally well."""
    present = {*result.objective.space.nuisances.unit.parameters}
    additional = set[str]()
    for alternative in result.alternatives:
        added = {*alternative.objective.space.nuisances.unit.parameters} - present
        # Most alternatives have the parameters of `result`, and need no comparison.
        if (
            added
            and alternative.residual_is_expected
            and share_of_residual(alternative, result) < SELECTION.equal_share
        ):
            additional |= added
    if not additional:
        return ()
    laws = [name for name, law in LAWS.items() if law.parameters[0] in additional]
    explanation = (
        f"with {', '.join(laws or sorted(additional))} the recording would be explained equally well"
    )
    return (f"{explanation}; the intervals include this alternative",)


def hopelessness_relative_to(before: SearchResult) -> Callable[[SearchResult], bool]:
    """Return the criterion for stopping the corrections of an estimate that makes no progress.

    If the estimate `before` does not explain the recording, an estimate that does has a clearly smaller
    residual; others are stopped. If the residual of `before` is expected, no estimate is stopped.
    """
    if before.residual_is_expected:
        return never
    return lambda tried: is_residual_above(tried, before, LAW_SELECTION.share)
