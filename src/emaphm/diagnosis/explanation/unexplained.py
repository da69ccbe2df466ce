"""Additional covariance of an estimate: for an unexplained recording, and for equally good alternatives.

The residual contains only the part of an error that has no parameter with a similar effect; the part with
such an effect may be as large. Laws that explain equally much lead to other estimates: the spread of these
alternatives about the reported estimate is added (model averaging: Hoeting, Madigan, Raftery and Volinsky
1999).
"""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.uncertainty.correlation import integral_time
from emaphm.quantiles import normal_quantile, student_t_quantile

COMPARABLE = 2.0
"""Largest ratio of the mean squared residual of an alternative to that of the estimate.

If the errors of all models exceed the noise, the model with the smallest residual is not necessarily nearest
to the truth. If the recording is explained, the alternative must also explain it. `make study` (limits,
plants) measures the effect.
"""


def unexplained_scores(result: SearchResult, jacobian: Array) -> Array:
    """Return the covariance (d, d) of the scores of an error that is as large as the residual.

    Σ_c (T_c / Δt) w_c² r_c² J_c J_cᵀ, with the observed rms r_c and largest integral time T_c: an upper bound
    for all errors with the spectrum of the residual or a flatter one. J is `jacobian` (d, channel rows).
    """
    problem = result.objective.problem
    parts = np.split(jacobian, len(problem.channels), axis=1)
    total = np.zeros((len(jacobian),) * 2)
    for residual, part, weight in zip(
        result.residual_by_channel.values(), parts, problem.weights, strict=True
    ):
        rows = integral_time([residual], [problem.inputs.interval]) / problem.inputs.interval
        total += rows * float(weight**2 * np.mean(residual**2)) * part @ part.T
    return total


def inflation(result: SearchResult, *, explained: bool) -> float:
    """Return the factor on the covariance of an estimate: 1.0 if it explains the recording.

    Otherwise it is the square of the normalised residual. The fit has absorbed the part of the model's error
    that has the effect of a parameter. The ratio of this part to the residual is assumed to be that of the
    residual to its expected size.
    """
    return 1.0 if explained else max(1.0, result.normalised_residual) ** 2


def alternatives_covariance(result: SearchResult, *, explained: bool) -> Array | float:
    """Return the covariance (d, d) due to the spread of the alternatives about the estimate.

    It is their mean squared distance, widened by Student's t of their number; 0.0 without alternatives.
    """
    comparable = [
        alternative
        for alternative in result.alternatives
        if _is_comparable(alternative, result, explained=explained)
    ]
    if not comparable:
        return 0.0
    differences = np.array([_difference(alternative, result) for alternative in comparable])
    widening = student_t_quantile(len(comparable), 0.975) / float(normal_quantile(0.975))
    return np.asarray(widening**2 * differences.T @ differences / len(comparable))


def _is_comparable(alternative: SearchResult, result: SearchResult, *, explained: bool) -> bool:
    """Return whether an alternative explains the recording about as well as the estimate."""
    comparable = alternative.residual_variance <= COMPARABLE * result.residual_variance
    return comparable and (alternative.residual_is_expected or not explained)


def _difference(alternative: SearchResult, result: SearchResult) -> Array:
    """Return the difference (d,) of an alternative from `result`; 0 in coordinates that it does not have."""
    values = _values_by_name(alternative.objective, alternative.point)
    estimates = zip(result.objective.space.coordinates, result.point.tolist(), strict=True)
    return np.array([values.get(name, value) - value for name, value in estimates])


def _values_by_name(objective: MapObjective, point: Array) -> dict[str, float]:
    """Return the coordinates of a point by name, without those of the unit, which differ between laws."""
    named = zip(objective.space.coordinates, point.tolist(), strict=True)
    return {name: value for name, value in named if not name.startswith(BASELINE)}
