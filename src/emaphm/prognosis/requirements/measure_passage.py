"""First failure times of a requirement on a measure along paths of levels, with few runs of the model."""

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator.faults import lower_bounds
from emaphm.arrays import Array
from emaphm.prognosis.bounds import within_bounds
from emaphm.prognosis.forecast import Paths
from emaphm.prognosis.requirements.margins import Limit, Requirements, vectors_of

Places = NDArray[np.intp]
"""Indices of steps or of paths."""

EVERY = 6
"""Interval, in steps, of the times of a path without a failure at which the measure is always computed: it
may jump, or fail and recover, between computed times without an indication."""

SCREENINGS = 3
"""Number of further times of each path that a regression on the computed margins chooses."""

AT_ONCE = ("free_play",)
"""Measures that need no run of the model, and are computed at every time of every path."""

CLIPPED = 2.0
"""Largest margin in the fit of the regression, relative to the median margin."""


def measure_passage(
    forecast: Paths, requirements: Requirements, limit: Limit, now: Array, last: Array
) -> Array:
    """Return the first failure times (n,) [h] of n paths for a `limit` on a measure; `inf` without a failure.

    A measure may fail and recover along a path, and each value needs a run of the averaged model, except for
    those in `AT_ONCE`. It is computed at the first and the last time of the path, at each sixth time in
    between while the path has not failed, and at times at which a regression on the margins computed so far,
    quadratic in the levels, first falls below 0 or is lowest; then by bisection before the first known
    failure. The regression chooses times only: a failure is always computed by the model.

    Parameters
    ----------
    now, last
        Margins at the first and at the last time, (n,), in the limit's unit; negative if violated.

    Raises
    ------
    MethodError
        The averaged model did not stay finite.
    """
    known = np.full((forecast.hours.size, now.size), np.nan)
    known[0], known[-1] = now, last
    works, least = now >= 0, float(lower_bounds(requirements.actuator)[0])

    def compute(steps: Places, paths: Places) -> None:
        if paths.size:
            vectors = vectors_of(forecast.level[steps, paths], requirements.actuator)
            known[steps, paths] = requirements.margins(vectors, [limit])[0]

    if limit.requirement.measure in AT_ONCE:
        for step in range(1, len(known) - 1):
            compute(np.full(now.size, step), np.arange(now.size))
    for step in range(EVERY, len(known) - 1, EVERY) if np.isnan(known).any() else ():
        paths = np.flatnonzero(works & (_bracket(known)[1] > step))
        compute(np.full(paths.size, step), paths)
    screenings = SCREENINGS if np.isnan(known).any() else 0
    level = within_bounds(forecast.level, least_friction=least) if screenings else forecast.level
    for _ in range(screenings):
        steps = _worth_computing(known, _regression(known, level))
        paths = np.flatnonzero(works & (steps > 0))
        compute(steps[paths], paths)
    while True:
        low, high = _bracket(known)
        paths = np.flatnonzero(works & (high - low > 1) & (high < len(known)))
        if not paths.size:
            break
        compute((low[paths] + high[paths]) // 2, paths)
    passage = np.where(works, np.inf, 0.0)
    paths = np.flatnonzero(works & (high < len(known)))
    low, high = low[paths], high[paths]
    margin_before, margin_after = known[low, paths], known[high, paths]
    # A margin that jumps, or that is 0 before the failure, is not interpolated.
    is_smooth = np.isfinite(margin_before) & np.isfinite(margin_after)
    is_smooth &= (margin_before > 0) | (limit.requirement.measure in AT_ONCE)
    before, after = (np.where(is_smooth, margin, 1.0) for margin in (margin_before, margin_after))
    share = np.where(is_smooth, before / np.where(is_smooth, before - after, 1.0), 1.0)
    passage[paths] = forecast.hours[low] + share * (forecast.hours[high] - forecast.hours[low])
    return passage


def _bracket(known: Array) -> tuple[Places, Places]:
    """Return the last step known to work before the first known failure, and that failure, (n,) each.

    The margins `known` (m, n) are NaN where not computed. The first step works; without a failure, high is m.
    """
    fails = known < 0
    high = np.where(fails.any(axis=0), fails.argmax(axis=0), len(known))
    works = (known >= 0) & (np.arange(len(known))[:, np.newaxis] < high)
    return len(known) - 1 - works[::-1].argmax(axis=0), high


def _worth_computing(known: Array, expected: Array) -> Places:
    """Return the step to compute next for each path, (n,), 0 for none; margins as in `_bracket`.

    It is the first expected failure before the first known failure. Without an expected failure, it is the
    step with the lowest expected margin if the path has no known failure.
    """
    _, high = _bracket(known)
    is_open = np.isnan(known) & (np.arange(len(known))[:, np.newaxis] < high)
    fails = is_open & (expected < 0)
    lowest = np.where(is_open, expected, np.inf).argmin(axis=0)
    lowest = np.where(is_open.any(axis=0) & (high == len(known)), lowest, 0)
    return np.where(fails.any(axis=0), fails.argmax(axis=0), lowest)


def _regression(known: Array, level: Array) -> Array:
    """Return margins (m, n) expected for `level` (m, n, 8) in bounds, by least squares on the `known` ones.

    Margins are relative to their median size. Margins beyond `CLIPPED`, also infinite ones, are clipped to
    it, because only their sign matters.
    """
    is_known = ~np.isnan(known)
    margins = known[is_known]
    finite_sizes = np.abs(margins[np.isfinite(margins) & (margins != 0)])
    target = np.clip(margins / (np.median(finite_sizes) if finite_sizes.size else 1.0), -CLIPPED, CLIPPED)
    coefficients = np.linalg.lstsq(_regressors(level[is_known]), target, rcond=1e-9)[0]
    return np.stack([_regressors(at_step) @ coefficients for at_step in level])


def _regressors(level: Array) -> Array:
    """Return the regressors (n, 45): 1, the levels (n, 8) and the products of two levels."""
    first, second = np.triu_indices(level.shape[1])
    return np.concatenate([np.ones((len(level), 1)), level, level[:, first] * level[:, second]], axis=1)
