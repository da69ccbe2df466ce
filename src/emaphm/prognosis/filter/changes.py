"""Changes of the particles in a filter state: laws, breaks of rates, onsets, scaling, hypotheses.

Each function takes a filter state and returns another; particles without a change are not computed.
"""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.belief import Belief
from emaphm.prognosis.laws import Mask, breaks, in_common, is_moving, keeps_rate
from emaphm.prognosis.prior import Hypotheses, Rows, replace_law_fields
from emaphm.random_streams import stream


def with_changed_laws(belief: Belief, step: float) -> Belief:
    """Return the filter state with the laws that change within `step` [h] drawn anew.

    A component with a rate before and after the change keeps its rate; otherwise the rate is drawn anew.
    """
    random = stream(belief.seed, "degradation", belief.steps, "change")
    s = belief.prior.settings
    changes = in_common(random.random(belief.law.shape)) < -np.expm1(-step / s.change_hours)
    if not changes.any():
        return belief
    rows = np.flatnonzero(changes.any(axis=1))
    drawn = belief.prior.general(belief.aged[rows], random)
    changes, law = changes[rows], belief.law[rows]
    kept = changes & keeps_rate(law, drawn.law)
    after = with_hypotheses(belief, rows, changes & ~kept, _of_same_stress(drawn, belief, rows))
    return replace(after, **replace_law_fields(after, rows, kept, drawn))


def after_onset(belief: Belief, sets_in: Mask, random: np.random.Generator) -> Belief:
    """Return the filter state with new rates where degradation starts: `sets_in` (n, 8) is True."""
    rows = np.flatnonzero(sets_in.any(axis=1))
    drawn = belief.prior.after_onset((rows.size, belief.law.shape[1]), random)
    return with_hypotheses(belief, rows, sets_in[rows], _of_same_stress(drawn, belief, rows))


def after_jump(
    belief: Belief, jumps: Mask, variance: float, law_kept: float, random: np.random.Generator
) -> Belief:
    """Return the filter state after `jumps` (n, 8) of the levels, which add `variance` to them.

    A level that was changing keeps its law and rate with the probability `law_kept`; otherwise degradation
    starts as after a sudden onset.
    """
    keeps_law = is_moving(belief.law) & (in_common(random.random(jumps.shape)) < law_kept)
    belief = after_onset(belief, jumps & ~keeps_law, random)
    levels = belief.levels.copy()
    np.einsum("nii->ni", levels)[jumps] += variance
    return replace(belief, levels=levels)


def _of_same_stress(drawn: Hypotheses, belief: Belief, rows: Rows) -> Hypotheses:
    """Return the hypotheses with the stress exponents of the `rows` of the filter state."""
    return drawn._replace(exponents=belief.exponents[rows])


def with_broken_rates(belief: Belief, step: Array) -> Belief:
    """Return the filter state with rates that break within `step` (n, 8) [h] multiplied by their factors."""
    random = stream(belief.seed, "degradation", belief.steps, "breaks")
    factor = breaks(belief.law, belief.life_scale, step, belief.prior.settings, random)
    rows = np.flatnonzero((factor != 1.0).any(axis=1))
    if not rows.size:
        return belief
    unity = np.ones((rows.size, factor.shape[1]))
    return replace(scaled(belief, rows, unity, factor[rows]), rate=belief.rate * factor)


def scaled(belief: Belief, rows: Rows, of_level: Array, of_rate: Array) -> Belief:
    """Return the filter state with covariances of `rows` (k,) scaled by factors (k, 8) of level and rate."""
    levels, mixed, rates = belief.levels.copy(), belief.mixed.copy(), belief.rates.copy()
    for part, left, right in (
        (levels, of_level, of_level),
        (mixed, of_level, of_rate),
        (rates, of_rate, of_rate),
    ):
        part[rows] = part[rows] * left[:, :, np.newaxis] * right[:, np.newaxis, :]
    return replace(belief, levels=levels, mixed=mixed, rates=rates)


def with_hypotheses(belief: Belief, rows: Rows, where: Mask, drawn: Hypotheses) -> Belief:
    """Return the filter state with new hypotheses and rates in `rows` (k,) where `where` (k, 8) is True."""
    mixed, rates = belief.mixed.copy(), belief.rates.copy()
    rate, exponents = belief.rate.copy(), belief.exponents.copy()
    place, column = np.nonzero(where)
    row = np.arange(len(rate))[rows][place]
    mixed[row, :, column] = 0.0
    rates[row, :, column] = rates[row, column, :] = 0.0
    rates[row, column, column] = drawn.rate_deviation[where] ** 2
    rate[row, column] = drawn.rate[where]
    exponents[row, column] = drawn.exponents[where]
    return replace(
        belief,
        **replace_law_fields(belief, rows, where, drawn),
        exponents=exponents,
        rate=rate,
        mixed=mixed,
        rates=rates,
    )
