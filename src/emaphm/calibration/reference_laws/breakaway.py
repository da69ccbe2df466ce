"""What acts where a shaft breaks away, as far as the reference model shows it.

The ripple of a switched current breaks a resting shaft away before its mean does. The averaged model has
less ripple or none: static friction acts on it more than on a machine, or by leaps of stick-slip. Its
sensitivities call an estimate well known that the reference model hardly distinguishes from others. Where
that has less of the effect than the averaged model, its residual decides: the estimate is where it is
least, known to where it is clearly larger.
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
"""Parameters that act where a shaft breaks away."""

STEP, RIGHT = 0.02, 0.8
"""Change by the logarithm over which effects are compared, and the share of the averaged model's effect that
the reference model must have to be as sensitive. Static friction has 0.99 on a six-step drive with a Stribeck
speed, 0.6 without, and less than 0.1 with comparators."""

Z = 2.0
"""Standard errors of such a share, by the switching of the runs that it is computed from."""

FIRST, LAST = 0.01, 0.64
"""Distances from the estimate that are tried, by the logarithm: doubled from the first to the last."""

SAID = 2.0
"""Ratio of standard errors, by the reference model and the averaged one, from which a warning says so."""


def with_breakaway(fit: UnitFit, seed: int) -> tuple[UnitFit, tuple[str, ...]]:
    """Return the fit with what acts at rest as the reference model shows it, and a warning on each of these.

    The others keep their values: what moves shows them.
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
        shift, error = _least(_cost_along(fit, column, seed))
        averaged = float(fit.standard_errors[i])
        if error <= averaged:
            continue
        deviations[i] += shift
        covariance[i] = covariance[:, i] = 0.0
        covariance[i, i] = error**2
        if error > SAID * averaged:
            warnings.append(
                f"{name} is known {error / averaged:.2g} times less well by the reference model, in which "
                "the ripple of the current breaks a resting shaft away, than by the averaged one"
            )
    return replace(fit, deviations=deviations, covariance=covariance), tuple(warnings)


def reference_share(fit: UnitFit, column: int, seed: int) -> float:
    """Return how much of a fitted parameter's effect in the averaged model the reference model surely has.

    The share Jᵀ J_ref / Jᵀ J of the effects on the residuals, less `Z` standard errors by its runs.
    """
    points = np.stack([fit.point, fit.point])
    points[:, column] += -STEP, STEP
    low, high = compared(fit.joint, points, seed, "share of an effect", column)
    both = squares = variance = 0.0
    for r, term in enumerate(fit.joint.terms):
        weight = 1 / term.residual_rms**2
        effect = low.residuals[r] - high.residuals[r]
        both += weight * float(effect @ (low.corrected_residuals[r] - high.corrected_residuals[r]))
        squares += weight * float(effect @ effect)
        errors = low.discrepancies[r].standard_error ** 2 + high.discrepancies[r].standard_error ** 2
        variance += weight**2 * float(effect**2 @ errors)
    return (both - Z * math.sqrt(variance)) / squares if squares else 0.0


def _cost_along(fit: UnitFit, column: int, seed: int) -> Callable[[float], float]:
    """Return the reference model's misfit by the distance from the estimate, of the logarithm."""

    def cost(distance: float) -> float:
        point = fit.point.copy()
        point[column] += distance
        (found,) = compared(fit.joint, point[np.newaxis], seed, "breakaway", column)
        return found.misfit

    return cost


def _least(cost: Callable[[float], float]) -> tuple[float, float]:
    """Return the distance of least cost, and its standard error: of an even distribution over equal ones.

    An error of `LARGEST_ERROR` where the costs are equal up to the last distance on one side.
    """
    known = {0.0: cost(0.0)}
    for side in (-1.0, 1.0):
        distance = FIRST
        while distance <= LAST:
            known[side * distance] = cost(side * distance)
            if known[side * distance] > EQUAL_COSTS**2 * min(known.values()):
                break
            distance *= 2
    places = sorted(known)
    equal = [i for i, place in enumerate(places) if known[place] <= EQUAL_COSTS * min(known.values())]
    if equal[0] == 0 or equal[-1] == len(places) - 1:
        return 0.0, LARGEST_ERROR
    low, high = places[equal[0] - 1], places[equal[-1] + 1]
    return (places[equal[0]] + places[equal[-1]]) / 2, (high - low) / math.sqrt(12)
