"""Gauss-Newton steps under the correction by the reference model, from a start near the optimum.

If a start is a few percent from the optimum, the discrepancy of the two models there and a step from
replicated Jacobians lead to it. Neither descents, which stop at local minima of the averaged model, nor a
choice between candidates, which needs further runs of the reference model, are then necessary.
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared, gauss_newton
from emaphm.estimation.discrepancy import reference_problem
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.random_streams import stream


@dataclass(frozen=True)
class CorrectedStepSettings:
    """Settings of the steps; `python -m emaphm.study.estimators` measures their effect.

    A step is `longest` at most. After a step longer than `short`, the models are compared again, `most` times
    in total. Of 40 random vectors, the error was 0.52 % (rms) with one comparison, 0.43 % until a short step.
    """

    longest: float = 0.1
    short: float = 0.01
    most: int = 8


CORRECTED_STEPS = CorrectedStepSettings()


def correct_by_steps(
    objective: MapObjective,
    point: Array,
    most: int,
    seed: int,
    settings: CorrectedStepSettings = CORRECTED_STEPS,
) -> SearchResult:
    """Return the estimate after corrected steps from `point` (d,), at most `most`, until a step is short.

    The estimate is the mean of the end of the last step and of one further step under the same correction,
    from Jacobians about that end: errors of the Jacobians at kinks average out. Its discrepancy is that of
    the last comparison, a short step away. It has converged if the last step is short.
    """
    reference = reference_problem(objective)
    for number in range(min(most, settings.most)):
        rng = stream(seed, "reference runs of a corrected step", number)
        (comparison,) = compared(objective, point[np.newaxis], reference, rng)
        comparison = comparison.reweighted()
        objective, correction = comparison.objective, comparison.outputs_correction
        _, step = _step(objective, point, comparison.residual, seed, number, settings)
        point = objective.space.project(point + step)
        converged = bool(np.linalg.norm(step) <= settings.short)
        if converged:
            break
    jacobians, step = _step(objective, point, objective.residual(point, correction), seed, "last", settings)
    end = objective.space.project(point + step / 2)
    result = SearchResult.at(objective, end, correction=correction, discrepancy=comparison.discrepancy)
    return replace(result, jacobians=jacobians, converged=converged)


def _step(
    objective: MapObjective,
    point: Array,
    residual: Array,
    seed: int,
    name: int | str,
    settings: CorrectedStepSettings,
) -> tuple[Array, Array]:
    """Return Jacobians (n, d, channel rows) about `point` (d,), and the step (d,) that they give."""
    jacobians = jacobians_at(objective, point, stream(seed, "Jacobians of a corrected step", name))
    step = gauss_newton(objective, point, residual, jacobians)
    return jacobians, step * (settings.longest / max(float(np.linalg.norm(step)), settings.longest))
