"""Covariance of an estimate from derivatives at it, and the remaining Gauss-Newton step."""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator.laws import typical_speed
from emaphm.arrays import Array, rms
from emaphm.estimation.discrepancy import has_reference, reference_problem
from emaphm.estimation.finite_differences import replicated_jacobians
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.covariance import sandwich_covariance
from emaphm.estimation.uncertainty.model_error import error_scores

JACOBIAN_STEP = 1e-2
"""Step of the differences, in the unit of a coordinate: it bridges the kinks of stick-slip."""

REPLICATES = 8
"""Number of Jacobians, each about its own point; `make study` measures the coverage of the intervals."""

RESPONSE_STEP, RESPONSE_REPLICATES = 2e-2, 16
"""Step and number of Jacobians of the reference model: the larger step and the mean reduce the effect of its
random switching."""

SLOW = 1 / 3
"""Largest speed of a slow motion, relative to the actuator's typical speed: 53 rad/s for the thesis's motor.

With sines of 1 to 10 Hz, the reference model's derivatives by a gain are 0.16 times the fitted model's at 11
rad/s (rms), 0.4 to 0.8 times at 22, 0.6 to 1 times at 44, 0.9 times at 56 and 0.98 times at 89 rad/s.
"""


@dataclass(frozen=True, eq=False)
class LocalCovariance:
    """The `covariance` (d, d) of least squares at a point, and a Gauss-Newton `step` (d,) from it."""

    covariance: Array
    step: Array


def jacobians_at(objective: MapObjective, point: Array, rng: np.random.Generator) -> Array:
    """Return replicated Jacobians (n, d, channel rows) of the channels about `point` (d,)."""
    rows = objective.channel_rows
    return replicated_jacobians(
        lambda points: objective.outputs(points)[:, :rows],
        point,
        objective.space,
        JACOBIAN_STEP,
        REPLICATES,
        rng,
    )


def response_of(result: SearchResult, rng: np.random.Generator) -> Array | None:
    """Return the derivatives (d, channel rows) of the reference model at the estimate of a slow motion.

    None for faster motions, where those of the fitted model are accurate enough for an interval. In a slow
    motion the ripple of the current, which the fitted model does not have, smooths dry friction: a gain then
    has a smaller effect than in the fitted model.
    """
    return reference_response(result, rng) if moves_slowly(result.objective.problem) else None


def moves_slowly(problem: Problem) -> bool:
    """Return whether the shaft has rests, or the command's rms speed is less than `SLOW`."""
    if problem.rests is not None:
        return True
    rates = np.diff(problem.measured["command_rad"]) / problem.inputs.interval
    speed = rms(rates) / problem.actuator.mechanics.gear_ratio
    return bool(speed < SLOW * typical_speed(problem.actuator))


def reference_response(result: SearchResult, rng: np.random.Generator) -> Array | None:
    """Return the derivatives (d, channel rows) of the reference model, if it can run, at an estimate."""
    objective = result.objective
    if not has_reference(objective.problem):
        return None
    reference = by_reference(objective)
    return np.asarray(
        replicated_jacobians(
            lambda points: reference.outputs(points)[:, : objective.channel_rows],
            result.point,
            objective.space,
            RESPONSE_STEP,
            RESPONSE_REPLICATES,
            rng,
        ).mean(axis=0)
    )


def by_reference(objective: MapObjective) -> MapObjective:
    """Return the objective with the outputs of the reference model and the same weights."""
    return replace(objective, problem=reference_problem(objective).like(objective.problem))


def jacobians_of(result: SearchResult, rng: np.random.Generator) -> Array:
    """Return the Jacobians (n, d, channel rows) at an estimate; they are computed if it has none."""
    if result.jacobians is not None:
        return result.jacobians
    return jacobians_at(result.objective, result.point, rng)


def local_covariance(
    objective: MapObjective,
    point: Array,
    residual: Array,
    jacobians: Array,
    bias: Array | float = 0.0,
    hidden_scores: Array | float = 0.0,
    response: Array | None = None,
) -> LocalCovariance:
    """Return the covariance at `point` (d,) from its `jacobians` (n, d, channel rows) and `residual`.

    The step leads towards the optimum. `residual` (channel rows,) is that at the point; `bias` is the part of
    it that is known to be an error of the model. The covariance includes the effect of a learned model error,
    of rounding in channels with visible counts, and of errors that the residual does not show:
    `hidden_scores` (d, d) is the covariance of the Jacobian times such an error. With a `response`
    (d, channel rows), the recording has these derivatives instead of the fitted model's.
    """
    faults, deviations = len(objective.space.columns), objective.space.prior_deviations
    channels = len(objective.problem.channels)
    mean = jacobians.mean(axis=0)
    scores = error_scores(objective.problem, mean) + rounding_scores(objective.problem, mean) + hidden_scores
    sandwich = sandwich_covariance(
        jacobians, residual, deviations, channels, scores, objective.correlated_rows, response
    )
    gradient = mean @ (residual - bias) / np.mean(residual**2)
    prior = objective.rows_of_priors / deviations**2
    gradient[faults:] -= prior[faults:] * point[faults:]
    step = np.linalg.solve(sandwich.information + np.diag(prior), gradient)
    return LocalCovariance(sandwich.covariance, step)


def rounding_scores(problem: Problem, jacobian: Array) -> Array:
    """Return the covariance (d, d) of a mean `jacobian` (d, channel rows) times shared rounding errors."""
    total = np.zeros((len(jacobian), len(jacobian)))
    by_channel = np.split(jacobian, len(problem.channels), axis=1)
    for name, weight, part in zip(problem.channels, problem.weights, by_channel, strict=True):
        if name in problem.shared_errors:
            total += weight**2 * problem.shared_errors[name].scores(part)
    return total
