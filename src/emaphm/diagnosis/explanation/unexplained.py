"""How far off an estimate may be where it does not explain its recording, or where others explain it as well.

What is left unexplained is seen only where it is like no parameter; as much of it may be like one. And laws
that explain as much lead to other estimates: model averaging (Hoeting, Madigan, Raftery and Volinsky 1999),
with the alternatives' spread about the one that is reported.
"""

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.uncertainty.correlation import integral_time
from emaphm.quantiles import normal_quantile, student_t_quantile

COMPARABLE = 2.0
"""Another end of a search counts next to the estimate up to this ratio of their mean squared residuals.

Of models that all are wrong by more than noise, the one that leaves least is not the nearest to the truth.
Where the recording is explained, the other must explain it too. `make study` (limits, plants) measures it.
"""


def unexplained_scores(result: SearchResult, jacobian: Array) -> Array:
    """Return the covariance (d, d) of `jacobian` (d, channel rows) times an error as large as the residual.

    Σ_c (T_c / Δt) w_c² r_c² J_c J_cᵀ: rms r_c and largest integral time T_c as observed, so an upper bound
    over all errors with the residual's spectrum or a flatter one.
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
    """Return the factor on the covariance of an estimate: 1.0 where it explains the recording.

    Else the square of the normalised residual. A fit has taken up of the model's error what is like a
    parameter, and may have taken up more than it left: as many times more, it is assumed, as it left more
    than is expected.
    """
    return 1.0 if explained else max(1.0, result.normalised_residual) ** 2


def alternatives_covariance(result: SearchResult, *, explained: bool) -> Array | float:
    """Return what the spread of the alternatives about the estimate adds to its covariance (d, d).

    Their mean square, as wide as Student's t of as many degrees of freedom; 0.0 without any.
    """
    kept = [one for one in result.alternatives if _comparable(one, result, explained=explained)]
    if not kept:
        return 0.0
    shifts = np.array([_shift(one, result) for one in kept])
    widening = student_t_quantile(len(kept), 0.975) / float(normal_quantile(0.975))
    return np.asarray(widening**2 * shifts.T @ shifts / len(kept))


def _comparable(other: SearchResult, result: SearchResult, *, explained: bool) -> bool:
    comparable = other.residual_variance <= COMPARABLE * result.residual_variance
    return comparable and (other.residual_is_expected or not explained)


def _shift(other: SearchResult, result: SearchResult) -> Array:
    """Return the estimate of `other` less that of `result`, (d,), 0 in coordinates that it does not have."""
    values = _values(other.objective, other.point)
    here = zip(result.objective.space.coordinates, result.point.tolist(), strict=True)
    return np.array([values.get(name, value) - value for name, value in here])


def _values(objective: MapObjective, point: Array) -> dict[str, float]:
    """Return the coordinates of a point by name, less those of the unit: they mean another thing by law."""
    named = zip(objective.space.coordinates, point.tolist(), strict=True)
    return {name: value for name, value in named if not name.startswith(BASELINE)}
