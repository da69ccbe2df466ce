"""Other explanations of a recording, under which a component has another value: a delay instead of a gain.

What was measured late, all of it together, looks like a lower position gain, and with other parameters free
the residual is the same within what the model is right to. The covariance at the estimate does not show that:
it knows of no delay. Where the gain is degraded, the estimate is therefore repeated with a delay either way.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.verdict import Estimate
from emaphm.estimation.multistart import local_search, with_descents
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream


@dataclass(frozen=True)
class AlternativeSettings:
    """Which other explanations are tried, and when one counts; `docs/spoilt.md` shows the effect.

    A `delay` [s] of all that was measured, in whole rows, late and early. It explains as well where
    descents with it leave less than `share` of the mean squared residual: true recordings left 1.07 and more,
    one that was late by 1 ms 1.003. A component counts as another where it is off by more than `difference`
    and more than the half-width of its interval.
    """

    delay: float = 4e-4
    share: float = 1.02
    difference: float = 0.02
    descents: int = 1


ALTERNATIVES = AlternativeSettings()


def with_alternatives(
    components: Mapping[str, Estimate], result: SearchResult, seed: int
) -> dict[str, Estimate]:
    """Return the `components` of `result`, undecided where another explanation has another value for them.

    Tried where the gain is degraded and the reference model has corrected the estimate.
    """
    if components["gain"].verdict != "degraded" or not result.correction.any():
        return dict(components)
    checked = dict(components)
    objective = result.objective
    interval = objective.problem.inputs.interval
    rows = max(1, round(ALTERNATIVES.delay / interval))
    as_it_is, _ = _refitted(result, objective, seed)
    for late in (rows, -rows):
        shifted = replace(objective, problem=_shifted(objective.problem, late))
        left, point = _refitted(result, shifted, seed)
        if left >= ALTERNATIVES.share * as_it_is:
            continue
        faults = objective.space.faults(point)
        for i, (name, one) in enumerate(components.items()):
            checked[name] = _including(checked[name], one, float(faults[i]), late * interval)
    return checked


def _shifted(problem: Problem, late: int) -> Problem:
    """Return the problem of a recording whose compared channels had come `late` rows late, now in time."""
    rows = np.clip(np.arange(problem.samples) + late, 0, problem.samples - 1)
    moved = {name: problem.measured[name][rows] for name in problem.channels}
    return replace(problem, measured={**problem.measured, **moved})


def _refitted(result: SearchResult, objective: MapObjective, seed: int) -> tuple[float, Array]:
    """Return the mean squared residual that a descent from the estimate leaves, and where it ends, (d,)."""
    correction, rng = result.outputs_correction, stream(seed, "descents to alternatives")
    descents = with_descents(ALTERNATIVES.descents)
    point = local_search(objective, result.point, correction, rng, descents).best
    residual = objective.residual(point, correction)[: objective.channel_rows]
    return float(np.mean(residual**2)), point


def _including(estimate: Estimate, first: Estimate, other: float, delay: float) -> Estimate:
    """Return an `estimate` with the value that an alternative has: undecided where that is another."""
    low, high = first.interval95
    least = max(ALTERNATIVES.difference, (high - low) / 2)
    if first.verdict == "cannot tell" or abs(other - first.value) <= least:
        return estimate
    interval = (min(estimate.interval95[0], other), max(estimate.interval95[1], other))
    way = "late" if delay > 0 else "early"
    reason = (
        f"the recording is explained as well by {other:.3f} where what was measured comes "
        f"{1e3 * abs(delay):.3g} ms {way}"
    )
    return replace(estimate, interval95=interval, verdict="cannot tell", reason=reason)
