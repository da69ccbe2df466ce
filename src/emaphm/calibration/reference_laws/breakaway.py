"""Parameters that act at breakaway, estimated with the reference model.

The ripple of a switched current makes a shaft at rest break away before the mean current does. The averaged
model has less ripple or none, so that static friction has a larger effect than in a machine, or an effect by
jumps of stick-slip. The sensitivities of the averaged model then give a small standard error although the
reference model hardly distinguishes different values. If the effect in the reference model is smaller than in
the averaged model, the estimate is the value with the smallest residual of the reference model; its standard
error follows from the distance at which the residual is clearly larger.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from emaphm.calibration.findings import LARGEST_ERROR
from emaphm.calibration.unit_fit import UnitFit
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.joint.correction import compared
from emaphm.estimation.reference.scan import EQUAL_COSTS

AT_REST = ("static", "stribeck_speed", "transition_speed", "presliding_stiffness", "presliding_damping")
"""Parameters that act at breakaway."""

STEP, RIGHT = 0.02, 0.8
"""Change of the logarithm of the parameter over which effects are compared, and least ratio of the reference
model's effect to the averaged model's effect at which the averaged model is accepted. For static friction the
ratio is 0.99 with a six-step drive and a Stribeck speed, 0.6 without the Stribeck speed, and less than 0.1
with comparators."""

Z = 2.0
"""Number of standard errors, by switching in the runs, that is subtracted from the ratio."""

FIRST, LAST = 0.01, 0.64
"""First and last distance from the estimate, by the logarithm; each distance is twice the previous one."""

SAID = 2.0
"""Ratio of the standard errors of reference and averaged model above which a warning is given."""


def with_breakaway(fit: UnitFit, seed: int) -> tuple[UnitFit, tuple[str, ...]]:
    """Return the fit with the `AT_REST` parameters estimated by the reference model, and warnings.

    The other parameters keep their values, because the motion identifies them.
    """
    problems = [term.objective.problem for term in fit.joint.terms]
    if not fit.estimate.corrected or not all(map(resolves_switching, problems)):
        return fit, ()
    deviations, covariance, warnings = fit.deviations.copy(), fit.covariance.copy(), []
    for name in AT_REST:
        if name not in fit.fitted or fit.at_bound[fit.free.index(name)]:
            continue
        i, column = fit.free.index(name), fit.fitted.index(name)
        if reference_share(fit, column, seed) >= RIGHT:
            continue
        shift, error = _minimum(_cost_along(fit, column, seed))
        averaged = float(fit.standard_errors[i])
        if error <= averaged:
            continue
        deviations[i] += shift
        covariance[i] = covariance[:, i] = 0.0
        covariance[i, i] = error**2
        if error > SAID * averaged:
            warnings.append(
                f"the standard error of {name} is {error / averaged:.2g} times as large by the reference "
                "model, in which the ripple of the current helps a shaft at rest to break away, as by the "
                "averaged model"
            )
    return replace(fit, deviations=deviations, covariance=covariance), tuple(warnings)


def reference_share(fit: UnitFit, column: int, seed: int) -> float:
    """Return the ratio of a parameter's effect in the reference model to its effect in the averaged model.

    It is Jᵀ J_ref / Jᵀ J, with the effects J on the residuals, less `Z` standard errors by switching.
    `column` is the index of the parameter in `fit.fitted`.
    """
    points = np.stack([fit.point, fit.point])
    points[:, column] += -STEP, STEP
    low, high = compared(fit.joint, points, seed, "share of an effect", column)
    products = squares = variance = 0.0
    for r, term in enumerate(fit.joint.terms):
        weight = 1 / term.residual_rms**2
        effect = low.residuals[r] - high.residuals[r]
        products += weight * float(effect @ (low.corrected_residuals[r] - high.corrected_residuals[r]))
        squares += weight * float(effect @ effect)
        errors = low.discrepancies[r].standard_error ** 2 + high.discrepancies[r].standard_error ** 2
        variance += weight**2 * float(effect**2 @ errors)
    return (products - Z * math.sqrt(variance)) / squares if squares else 0.0


def _cost_along(fit: UnitFit, column: int, seed: int) -> Callable[[float], float]:
    """Return the misfit of the reference model as a function of the distance from the estimate."""

    def cost(distance: float) -> float:
        point = fit.point.copy()
        point[column] += distance
        (outcome,) = compared(fit.joint, point[np.newaxis], seed, "breakaway", column)
        return outcome.misfit

    return cost


def _minimum(cost: Callable[[float], float]) -> tuple[float, float]:
    """Return the distance with the smallest cost, and its standard error.

    The standard error is that of a uniform distribution over the interval of practically equal costs. It is
    `LARGEST_ERROR`, at the distance 0, if the costs are equal up to the last distance on one side.
    """
    costs = {0.0: cost(0.0)}
    for side in (-1.0, 1.0):
        distance = FIRST
        while distance <= LAST:
            costs[side * distance] = cost(side * distance)
            if costs[side * distance] > EQUAL_COSTS**2 * min(costs.values()):
                break
            distance *= 2
    distances = sorted(costs)
    equal = [i for i, place in enumerate(distances) if costs[place] <= EQUAL_COSTS * min(costs.values())]
    if equal[0] == 0 or equal[-1] == len(distances) - 1:
        return 0.0, LARGEST_ERROR
    low, high = distances[equal[0] - 1], distances[equal[-1] + 1]
    return (distances[equal[0]] + distances[equal[-1]]) / 2, (high - low) / math.sqrt(12)
