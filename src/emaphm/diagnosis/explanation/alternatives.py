"""Other explanations of a recording, under which a component has another value: a delay instead of a gain.

What was measured late, all of it together, looks like a lower position gain, and with other parameters free
the residual is the same within what the model is right to. The covariance at the estimate does not show that:
it contains no delay. Where the gain is degraded, the estimate is therefore repeated with a delay either way.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.other_values import with_other_value
from emaphm.diagnosis.explanation.refits import Refit
from emaphm.diagnosis.explanation.sensor_scores import taken_up_of_a_delay
from emaphm.diagnosis.verdict import Estimate, with_phase_undecided
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult


@dataclass(frozen=True)
class AlternativeSettings:
    """Which other explanations are tried, and when one counts; `make study` (spoilt) measures it.

    `delays` [s] of all that was measured, in whole rows, late and early. One explains as well where a refit
    with it has less than `share` of the misfit. Nearly healthy actuators in time had 1.15 and more, at 0.2
    and 0.4 ms (12 recordings); those that were 0.2 ms late had 0.92 to 1.06 at 0.2 ms, and 1.04 to 1.15 at
    0.4 ms: both are tried. None is tried of which the linear model at the estimate leaves `hopeless` times
    the residual: descents then left 1.7 and more (140 recordings). Intervals include what explains as well;
    where all of such an interval says the same, the verdict stays.

    A delay up to `tolerance` standard deviations of its prior is never excluded; by the usual prior 0.23 ms,
    one row at 5 kHz or the lag of a filter at 700 Hz. A gain that is nearer to healthy than such a delay
    makes it, 0.04 to 0.05 on the thesis's actuator, is not degraded. One beyond `possible` standard
    deviations is not tried. The owner of a rig whose channels are synchronous says so by a smaller `delay`
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
    """Return the `components` of `result`, undecided where another explanation has another value for them.

    Tried where the gain is degraded and the reference model has corrected the estimate. `jacobians`,
    (n, d, channel rows), are those of the channels there.
    """
    if components["gain"].verdict != "degraded" or not result.correction.any():
        return dict(components)
    checked = dict(components)
    checked["gain"] = beyond_a_delay(components["gain"], result, jacobians)
    objective = result.objective
    interval = objective.problem.inputs.interval
    jacobian = jacobians.mean(axis=0)
    possible = []
    for late in _rows_late(interval, objective.problem.actuator.nuisances.delay):
        shifted = replace(objective, problem=_shifted(objective.problem, late))
        share, step = _linear_fit(result, shifted, jacobian)
        if share < ALTERNATIVES.hopeless:
            possible.append((late, shifted, step))
    if not possible:
        return checked
    as_it_is = Refit.under(objective, result.point[np.newaxis], result)
    for late, shifted, step in possible:
        starts = objective.space.project(np.array([result.point, result.point + step]))
        refit = Refit.under(shifted, starts, result).corrected(as_it_is, seed, f"a delay of {late} rows")
        if refit.misfit >= ALTERNATIVES.share * as_it_is.misfit:
            continue
        faults = objective.space.faults(refit.point)
        way = "late" if late > 0 else "early"
        why = f"where what was measured comes {1e3 * abs(late) * interval:.3g} ms {way}"
        for i, (name, one) in enumerate(components.items()):
            checked[name] = with_other_value(name, checked[name], one, float(faults[i]), why)
    return with_phase_undecided(checked, components)


def beyond_a_delay(gain: Estimate, result: SearchResult, jacobians: Array) -> Estimate:
    """Return the degraded gain, undecided where a delay within `tolerance` takes its interval to healthy.

    `jacobians` (n, d, channel rows) are those at `result`.
    """
    column = result.objective.space.coordinates.index("gain")
    tolerance = ALTERNATIVES.tolerance * result.objective.problem.actuator.nuisances.delay
    taken_up = taken_up_of_a_delay(result, jacobians, tolerance)
    low, high = gain.interval95
    apart = max(low - HEALTHY.gain, HEALTHY.gain - high)
    if apart > abs(float(taken_up[column])):
        return gain
    reason = (
        f"{1e3 * tolerance:.2g} ms between the command and what was measured would look alike; if the "
        "channels are more synchronous, say so by 'delay' under [nuisances] in the actuator's TOML"
    )
    return replace(gain, verdict="cannot tell", reason=reason)


def _rows_late(interval: float, prior: float) -> list[int]:
    """Return the delays that are tried, in rows of an `interval` [s], at least one either way.

    None beyond `possible` standard deviations of their `prior` [s].
    """
    possible = [delay for delay in ALTERNATIVES.delays if delay <= ALTERNATIVES.possible * prior]
    rows = {max(1, round(delay / interval)) for delay in possible}
    return sorted(rows | {-late for late in rows})


def _shifted(problem: Problem, late: int) -> Problem:
    """Return the problem of a recording whose compared channels had come `late` rows late, now in time."""
    moved = {name: taken_back(problem.measured[name], late) for name in problem.channels}
    return replace(problem, measured={**problem.measured, **moved})


def _linear_fit(result: SearchResult, shifted: MapObjective, jacobian: Array) -> tuple[float, Array]:
    """Return what `shifted` leaves of the mean squared residual of `result`, by the linear model there.

    And the step (d,) that leads there. `jacobian` (d, channel rows) is the mean of those at `result`.
    """
    rows = result.objective.channel_rows
    present = result.residual[:rows]
    moved = (shifted.target - result.outputs - result.outputs_correction)[:rows]
    step = np.asarray(np.linalg.lstsq(jacobian.T, moved)[0], float)
    left = moved - step @ jacobian
    return float(left @ left / max(float(present @ present), np.finfo(float).tiny)), step


def taken_back(rows: Array, late: int) -> Array:
    """Return rows (…, samples) that had come `late` rows late, in time; the end values are held."""
    last = rows.shape[-1] - 1
    return rows[..., np.clip(np.arange(last + 1) + late, 0, last)]
