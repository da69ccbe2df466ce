"""When a requirement that is a measure first fails along paths of levels, with few runs of the model."""

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
"""Of the times of a path that has not failed, which are computed at least: a measure may jump, or fail and
recover, where nothing that is known shows it."""

SCREENINGS = 3
"""How often a regression on what was computed then chooses the next time of each path that is computed."""

AT_ONCE = ("free_play",)
"""Measures that are computed at every time of every path: without a run of the model."""

CLIPPED = 2.0
"""Largest margin that the regression is fitted to, in units of the median one."""


def measure_passage(made: Paths, requirements: Requirements, limit: Limit, now: Array, last: Array) -> Array:
    """Return when each of n paths first fails a `limit` on a measure [h], (n,); `inf` where it does not.

    A measure may fail and recover along a path, and each of its values is a run of the averaged model, but of
    those in `AT_ONCE`. It is computed at the path's first and last time, at each sixth between while it has
    not failed, and where a regression on the margins computed so far, quadratic in the levels, first falls
    below 0, or is lowest; then by bisection up to the first time that is known to fail. The regression
    chooses times only: a failure is always one of the model.

    Parameters
    ----------
    now, last
        Margins at the first and at the last time, (n,), in the limit's unit; negative beyond it.

    Raises
    ------
    MethodError
        The averaged model did not stay finite.
    """
    known = np.full((made.hours.size, now.size), np.nan)
    known[0], known[-1] = now, last
    works, least = now >= 0, float(lower_bounds(requirements.actuator)[0])

    def compute(steps: Places, paths: Places) -> None:
        if paths.size:
            vectors = vectors_of(made.level[steps, paths], requirements.actuator)
            known[steps, paths] = requirements.margins(vectors, [limit])[0]

    if limit.requirement.measure in AT_ONCE:
        for step in range(1, len(known) - 1):
            compute(np.full(now.size, step), np.arange(now.size))
    for step in range(EVERY, len(known) - 1, EVERY) if np.isnan(known).any() else ():
        paths = np.flatnonzero(works & (_bracket(known)[1] > step))
        compute(np.full(paths.size, step), paths)
    screenings = SCREENINGS if np.isnan(known).any() else 0
    level = within_bounds(made.level, least_friction=least) if screenings else made.level
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
    passed = np.where(works, np.inf, 0.0)
    paths = np.flatnonzero(works & (high < len(known)))
    low, high = low[paths], high[paths]
    before, after = known[low, paths], known[high, paths]
    # Where it jumps, or stands at its limit until it fails, there is nothing to interpolate.
    is_smooth = np.isfinite(after) & ((before > 0) | (limit.requirement.measure in AT_ONCE))
    share = np.where(is_smooth, before / np.where(is_smooth, before - after, 1.0), 1.0)
    passed[paths] = made.hours[low] + share * (made.hours[high] - made.hours[low])
    return passed


def _bracket(known: Array) -> tuple[Places, Places]:
    """Return the first step of each path known to fail, and the last before it known to work, (n,) both.

    Of margins (m, n), NaN where they are not known. The first step works; where none fails, high is m.
    """
    fails = known < 0
    high = np.where(fails.any(axis=0), fails.argmax(axis=0), len(known))
    works = (known >= 0) & (np.arange(len(known))[:, np.newaxis] < high)
    return len(known) - 1 - works[::-1].argmax(axis=0), high


def _worth_computing(known: Array, expected: Array) -> Places:
    """Return the step to compute next of each path, (n,), 0 where none is; margins as in `_bracket`.

    The first that is expected to fail, before the first known to; where none does, the lowest, of a path that
    is not known to fail.
    """
    _, high = _bracket(known)
    is_open = np.isnan(known) & (np.arange(len(known))[:, np.newaxis] < high)
    fails = is_open & (expected < 0)
    lowest = np.where(is_open, expected, np.inf).argmin(axis=0)
    lowest = np.where(is_open.any(axis=0) & (high == len(known)), lowest, 0)
    return np.where(fails.any(axis=0), fails.argmax(axis=0), lowest)


def _regression(known: Array, level: Array) -> Array:
    """Return margins (m, n) expected of `level` (m, n, 8) in bounds, by least squares on those `known`.

    In units of the usual margin, those beyond `CLIPPED` of them, infinite ones too, as large as that: only
    their sign matters there.
    """
    is_known = ~np.isnan(known)
    margins = known[is_known]
    usual = np.abs(margins[np.isfinite(margins) & (margins != 0)])
    target = np.clip(margins / (np.median(usual) if usual.size else 1.0), -CLIPPED, CLIPPED)
    found = np.linalg.lstsq(_terms(level[is_known]), target, rcond=1e-9)[0]
    return np.stack([_terms(one) @ found for one in level])


def _terms(level: Array) -> Array:
    """Return 1, the levels (n, 8) and their products of two, (n, 45)."""
    first, second = np.triu_indices(level.shape[1])
    return np.concatenate([np.ones((len(level), 1)), level, level[:, first] * level[:, second]], axis=1)
