"""Other explanations of a recording, with other values of the components: a delay instead of a gain.

A common delay of all measured channels has the same effect as a lower position gain; with other parameters
free the residuals are equal within the accuracy of the model. The covariance at the estimate does not include
this, because it contains no delay. If the gain is degraded, the estimate is therefore repeated with delays of
both signs.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.other_values import with_other_value
from emaphm.diagnosis.explanation.refits import Refit
from emaphm.diagnosis.explanation.sensor_scores import shift_by_delay
from emaphm.diagnosis.verdict import Estimate, distance_from, with_phase_undecided
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult


@dataclass(frozen=True)
class AlternativeSettings:
    """Delays that are tried, and when one is accepted; `make study` (spoilt) measures the effect.

    `delays` [s] of all measured channels, in whole rows, late and early. A delay explains the recording
    equally well if a refit with it has less than `share` of the misfit. Nearly healthy actuators without a
    delay had 1.15 and more, at 0.2 and 0.4 ms (12 recordings); recordings 0.2 ms late had 0.92 to 1.06 at 0.2
    ms, and 1.04 to 1.15 at 0.4 ms: both are tried. A delay is not tried if the residual of the linear model
    with it is `hopeless` times as large: after descents it was 1.7 times and more (140 recordings). Intervals
    include the values with an accepted delay; the verdict stays if it is that of the whole interval.

    A delay up to `tolerance` standard deviations of its prior is never excluded; with the usual prior, this
    is 0.23 ms, one row at 5 kHz or the lag of a filter at 700 Hz. A gain is not degraded if its distance from
    healthy is less than the effect of such a delay, 0.04 to 0.05 on the thesis's actuator. Delays beyond
    `possible` standard deviations are not tried. For a rig with synchronous channels, state a smaller `delay`
    under `[nuisances]`.
    """

    delays: tuple[float, ...] = (2e-4, 4e-4)
    share: float = 1.1
    hopeless: float = 3.0
    tolerance: float = 1.15
    possible: float = 3.0


ALTERNATIVES = AlternativeSettings()


def with_alternatives(
    components: Mapping[str, Estimate], result: SearchResult, jacobians: Array, seed: int
) -> dict[str, Estimate]:
    """Return the `components` of `result`; those whose verdict depends on a delay are undecided.

    Delays are tried if the gain is degraded and the reference model has corrected the estimate. `jacobians`
    (n, d, channel rows) are those of the channels at the estimate.
    """
    if components["gain"].verdict != "degraded" or not result.correction.any():
        return dict(components)
    checked = dict(components)
    checked["gain"] = beyond_a_delay(components["gain"], result, jacobians)
    objective = result.objective
    interval = objective.problem.inputs.interval
    jacobian = jacobians.mean(axis=0)
    possible = []
    for late in _delays_in_rows(interval, objective.problem.actuator.nuisances.delay):
        shifted = replace(objective, problem=_shifted(objective.problem, late))
        share, step = _linear_fit(result, shifted, jacobian)
        if share < ALTERNATIVES.hopeless:
            possible.append((late, shifted, step))
    if not possible:
        return checked
    without_delay = Refit.under(objective, result.point[np.newaxis], result)
    for late, shifted, step in possible:
        starts = objective.space.project(np.array([result.point, result.point + step]))
        refit = Refit.under(shifted, starts, result).corrected(without_delay, seed, f"a delay of {late} rows")
        if refit.misfit >= ALTERNATIVES.share * without_delay.misfit:
            continue
        faults = objective.space.faults(refit.point)
        way = "late" if late > 0 else "early"
        why = f"if all measured channels are {1e3 * abs(late) * interval:.3g} ms {way}"
        for i, (name, component) in enumerate(components.items()):
            checked[name] = with_other_value(name, checked[name], component, float(faults[i]), why)
    return with_phase_undecided(checked, components)


def beyond_a_delay(gain: Estimate, result: SearchResult, jacobians: Array) -> Estimate:
    """Return the degraded gain; it is undecided if a delay within `tolerance` shifts its interval to healthy.

    `jacobians` (n, d, channel rows) are those at `result`.
    """
    column = result.objective.space.coordinates.index("gain")
    tolerance = ALTERNATIVES.tolerance * result.objective.problem.actuator.nuisances.delay
    shift = shift_by_delay(result, jacobians, tolerance)
    if distance_from(HEALTHY.gain, gain.interval95) > abs(float(shift[column])):
        return gain
    reason = (
        f"a delay of {1e3 * tolerance:.2g} ms between command and measured channels would have the same "
        "effect; if the channels are more synchronous, state a smaller 'delay' under [nuisances] in the "
        "actuator's TOML"
    )
    return replace(gain, verdict="cannot tell", reason=reason)


def _delays_in_rows(interval: float, prior: float) -> list[int]:
    """Return the delays that are tried, in rows of an `interval` [s], of both signs, at least one row each.

    Delays beyond `possible` standard deviations of their `prior` [s] are omitted.
    """
    possible = [delay for delay in ALTERNATIVES.delays if delay <= ALTERNATIVES.possible * prior]
    rows = {max(1, round(delay / interval)) for delay in possible}
    return sorted(rows | {-late for late in rows})


def _shifted(problem: Problem, late: int) -> Problem:
    """Return the problem with the compared channels shifted by `late` rows, to compensate for this delay."""
    moved = {name: taken_back(problem.measured[name], late) for name in problem.channels}
    return replace(problem, measured={**problem.measured, **moved})


def _linear_fit(result: SearchResult, shifted: MapObjective, jacobian: Array) -> tuple[float, Array]:
    """Return the share of the mean squared residual of `result` with `shifted`, by the linear model.

    The second value is the step (d,) to its minimum. `jacobian` (d, channel rows) is the mean at `result`.
    """
    rows = result.objective.channel_rows
    present = result.residual[:rows]
    target = (shifted.target - result.outputs - result.outputs_correction)[:rows]
    step = np.asarray(np.linalg.lstsq(jacobian.T, target)[0], float)
    remaining = target - step @ jacobian
    return float(remaining @ remaining / max(float(present @ present), np.finfo(float).tiny)), step


def taken_back(rows: Array, late: int) -> Array:
    """Return `rows` (…, samples) that were `late` rows late, shifted back; the end values are repeated."""
    last = rows.shape[-1] - 1
    return rows[..., np.clip(np.arange(last + 1) + late, 0, last)]
