"""The covariance of an estimate, and the Gauss-Newton step that it still asks for."""

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
"""Jacobians, each about a point of its own; `make study` measures the coverage of what comes of them."""

RESPONSE_STEP, RESPONSE_REPLICATES = 2e-2, 16
"""The same of the reference model: its switching is chance, which the larger step and the mean leave out."""

SLOW = 1 / 3
"""Speed of a slow motion over the actuator's typical one: 53 rad/s at the thesis's motor.

Of sines of 1 to 10 Hz, the reference model's derivatives by a gain are 0.16 of the fitted model's at 11 rad/s
(rms), 0.4 to 0.8 at 22, 0.6 to 1 at 44, 0.9 at 56 and 0.98 at 89.
"""


@dataclass(frozen=True, eq=False)
class LocalCovariance:
    """The `covariance` (d, d) of the least squares at a point, and a Gauss-Newton `step` (d,) from it."""

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
    """Return the derivatives (d, channel rows) of the reference model at an estimate that moves slowly.

    None of others: near enough to the fitted model's for an interval. Where motion is slow, the ripple of the
    current, which the fitted model lacks, takes the edge off dry friction: a gain does less than the fitted
    model says.
    """
    return reference_response(result, rng) if moves_slowly(result.objective.problem) else None


def moves_slowly(problem: Problem) -> bool:
    """Return whether the shaft rests, or the command asks for less than `SLOW` on the average (rms)."""
    if problem.rests is not None:
        return True
    rates = np.diff(problem.measured["command_rad"]) / problem.inputs.interval
    speed = rms(rates) / problem.actuator.mechanics.gear_ratio
    return bool(speed < SLOW * typical_speed(problem.actuator))


def reference_response(result: SearchResult, rng: np.random.Generator) -> Array | None:
    """Return the derivatives (d, channel rows) of the reference model at an estimate, None without one."""
    objective = result.objective
    if not has_reference(objective.problem):
        return None
    answering = by_reference(objective)
    return np.asarray(
        replicated_jacobians(
            lambda points: answering.outputs(points)[:, : objective.channel_rows],
            result.point,
            objective.space,
            RESPONSE_STEP,
            RESPONSE_REPLICATES,
            rng,
        ).mean(axis=0)
    )


def by_reference(objective: MapObjective) -> MapObjective:
    """Return an objective whose outputs are those of the reference model, weighted as before."""
    return replace(objective, problem=reference_problem(objective).like(objective.problem))


def jacobians_of(result: SearchResult, rng: np.random.Generator) -> Array:
    """Return Jacobians (n, d, channel rows) at an estimate: those that are known, or new ones."""
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
    """Return the covariance at `point` (d,), by `jacobians` and the `residual` (channel rows,) there.

    The step is towards the optimum; `bias` is the part of the residual that is known to be the model's. Where
    a calibration has learned the model's error, the covariance has what that makes of an estimate, and where
    a channel shows counts, what these leave open. So it has what `hidden_scores` (d, d) are the covariance
    of, Jacobian times an error that the residual does not show. With a `response` (d, channel rows), the
    recording answers by these derivatives and not by the model's.
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
