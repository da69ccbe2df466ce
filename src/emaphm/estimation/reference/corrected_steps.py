"""Gauss-Newton steps under the correction by the reference model, from a start near the optimum.

If a start is a few percent from the optimum, the discrepancy of the two models there and a step from
replicated Jacobians lead to it. Neither descents, which stop at local minima of the averaged model, nor a
choice between candidates, which needs further runs of the reference model, are then necessary. The
iterations after a global search (`emaphm.estimation.bias_correction`) take twice as many runs, and the mean
of their last estimates has a smaller error: 0.31 % in place of 0.38 % without noise, 0.41 % in place of
0.44 % with noise (rms of 24 recordings).
"""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.estimation.bias_correction import compared, gauss_newton
from emaphm.estimation.correction_iterations import shortened
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
    most: int = 4


CORRECTED_STEPS = CorrectedStepSettings()


def correct_by_steps(objective: MapObjective, point: Array, most: int, seed: int) -> SearchResult:
    """Return the estimate after corrected steps from `point` (d,), at most `most`, until a step is short.

    Its discrepancy and its Jacobians are those of the last comparison, one step away. It has converged if
    that step is short.
    """
    reference = reference_problem(objective)
    for number in range(min(most, CORRECTED_STEPS.most)):
        rng = stream(seed, "reference runs of a corrected step", number)
        (comparison,) = compared(objective, point[np.newaxis], reference, rng)
        comparison = comparison.reweighted()
        objective = comparison.objective
        jacobians = jacobians_at(objective, point, stream(seed, "Jacobians of a corrected step", number))
        step = gauss_newton(objective, point, comparison.residual, jacobians)
        step = shortened(step, CORRECTED_STEPS.longest)
        point = objective.space.project(point + step)
        converged = bool(np.linalg.norm(step) <= CORRECTED_STEPS.short)
        if converged:
            break
    correction = comparison.outputs_correction
    result = SearchResult.at(objective, point, correction=correction, discrepancy=comparison.discrepancy)
    return replace(result, jacobians=jacobians, converged=converged)
