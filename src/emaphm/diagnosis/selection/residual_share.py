"""What an estimate leaves of the residual, next to what another leaves, and when it is given up for that."""

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


def leaves_as_much(tried: SearchResult, before: SearchResult, share: float) -> bool:
    """Return whether `tried` leaves more than a `share` of what `before` does not explain.

    Of the residual of all channels, and of the primary one's square beyond noise and switching.
    """
    beyond, beyond_before = (one.normalised_residual**2 - 1 for one in (tried, before))
    return beyond > share * beyond_before and share_of_residual(tried, before) > share


def notes_on_alternatives(result: SearchResult) -> tuple[str, ...]:
    """Return a note on laws, or parameters, with which others explain the recording as well; none without."""
    here = {*result.objective.space.nuisances.unit.parameters}
    others = set[str]()
    for one in result.alternatives:
        own = {*one.objective.space.nuisances.unit.parameters} - here
        # Most alternatives are of the same description, and need no comparison.
        if own and one.residual_is_expected and share_of_residual(one, result) < SELECTION.equal_share:
            others |= own
    if not others:
        return ()
    laws = [name for name, law in LAWS.items() if law.parameters[0] in others]
    what = f"with {', '.join(laws or sorted(others))} the recording would be explained as well"
    return (f"{what}; the intervals hold that too",)


def hopeless_next_to(before: SearchResult) -> Callable[[SearchResult], bool]:
    """Return what says whether an estimate that makes no progress is given up.

    It is tried because the estimate `before` does not explain the recording: what does leaves clearly less.
    Where its residual is expected, none is.
    """
    if before.residual_is_expected:
        return never
    return lambda tried: leaves_as_much(tried, before, LAW_SELECTION.share)
