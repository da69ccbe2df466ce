"""Covariance of an estimate, and sets of parameters that are identifiable only in combination."""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator.requirements import component_of
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.unexplained import alternatives_covariance, inflation, unexplained_scores
from emaphm.diagnosis.verdict import VERDICT, Z95
from emaphm.estimation.compared_channels import comparable_channels
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import DEFAULT_SCATTER, SearchResult
from emaphm.estimation.space.nuisances import BASELINE, KNOWN_BY
from emaphm.estimation.space.parameter_space import PRIOR_DEVIATION
from emaphm.estimation.uncertainty.collinearity import CollinearSet, collinear_coordinates, resolving_channels
from emaphm.estimation.uncertainty.further_channels import further_channels_information
from emaphm.estimation.uncertainty.local_covariance import (
    jacobians_at,
    jacobians_of,
    local_covariance,
    response_of,
)
from emaphm.estimation.uncertainty.model_error import apparent_fault_covariance
from emaphm.estimation.uncertainty.slow_rows import step_by_other_command
from emaphm.estimation.uncertainty.switching_scores import switching_errors, switching_scores
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class Identifiability:
    """The `covariance` (d, d) of an estimate, and its `collinear_sets`.

    `model_error_share` (d,) is the share of each variance due to the model error that a calibration learned.
    """

    covariance: Array
    collinear_sets: tuple[CollinearSet, ...]
    model_error_share: Array


def identifiability(result: SearchResult, seed: int, *, explained: bool = True) -> Identifiability:
    """Return the covariance and the collinear sets of the estimate of `result`.

    The covariance is the sum of the covariance due to the data, the scatter of the optimiser, the apparent
    faults of healthy recordings where a calibration has learned them, the spread of alternatives that fit
    equally well, and, of slow motions, the effect of switching on the estimate (`switching_errors`). Where
    the recording is not `explained`, it also includes an error that is as large as the residual and has the
    effect of a parameter, and is multiplied by the squared normalised residual. Where the search has not
    converged (a population method), or motion is slow (`response_of`: part of the model's discrepancy is not
    corrected), a Gauss-Newton step to the optimum remains, and its square is added. The square of the step
    that another course of the command between slow rows would cause is also added.
    """
    objective, space = result.objective, result.objective.space
    rows = objective.channel_rows
    jacobians = jacobians_of(result, stream(seed, "Jacobians of the covariance"))
    residual, bias = result.fitted_residual[:rows], result.remaining_bias[:rows]
    mean = jacobians.mean(axis=0)
    hidden = switching_scores(mean, switching_errors(result, stream(seed, "switching of the covariance")))
    if not explained:
        hidden = hidden + unexplained_scores(result, mean)
    response = response_of(result, stream(seed, "Jacobians of the response"))
    local = local_covariance(objective, result.point, residual, jacobians, bias, hidden, response)
    apparent = apparent_fault_covariance(objective.problem.actuator, space.coordinates)
    covariance = inflation(result, explained=explained) * local.covariance + result.scatter + apparent
    covariance = covariance + alternatives_covariance(result, explained=explained)
    sets = collinear_sets(result, covariance, seed)
    if response is not None or not result.converged:
        remaining = space.project(result.point + local.step) - result.point
        covariance = covariance + np.outer(remaining, remaining)
    moved = step_by_other_command(objective, result.point, residual, jacobians)
    if moved is not None:
        covariance = covariance + np.outer(moved, moved)
    added = apparent
    if objective.problem.model_error:
        exact = replace(objective, problem=replace(objective.problem, model_error={}))
        without = local_covariance(
            exact, result.point, residual, jacobians, bias, hidden, response
        ).covariance
        added = added + inflation(result, explained=explained) * (local.covariance - without)
    share = np.diag(np.broadcast_to(added, covariance.shape)) / np.diag(covariance)
    return Identifiability(covariance, sets, share)


def collinear_sets(result: SearchResult, covariance: Array, seed: int) -> tuple[CollinearSet, ...]:
    """Return the sets of parameters of which only a combination is identifiable, by the `covariance` (d, d).

    Sets that contain nuisances only are omitted, and so are components with sufficiently small intervals.
    """
    space = result.objective.space
    faults, names = len(space.columns), space.coordinates
    half_widths = Z95 * np.sqrt(np.diag(covariance))
    members_of: dict[tuple[str, ...], list[int]] = {}
    for members in collinear_coordinates(covariance):
        relevant = [i for i in members if i >= faults or half_widths[i] > VERDICT.healthy_margin]
        labels = tuple(dict.fromkeys(_parameter_name(names[i]) for i in relevant))
        if len(labels) > 1 and relevant[0] < faults:
            members_of[labels] = relevant
    if not members_of:
        return ()
    information = further_information(result, seed)
    channels = result.objective.problem.channels
    return tuple(
        CollinearSet(labels, channels, resolving_channels(covariance, members, information))
        for labels, members in members_of.items()
    )


def _parameter_name(coordinate: str) -> str:
    """Return the parameter of a coordinate: eccentricity and baseline have several coordinates."""
    if coordinate.startswith(BASELINE):
        name = coordinate.removeprefix(BASELINE)
        return "the baseline" if name.isdigit() else f"the unit's {name}"
    return component_of(coordinate)


def further_information(result: SearchResult, seed: int) -> dict[str, Array]:
    """Return the information (d, d) that each unrecorded channel would add, by its name."""
    objective = result.objective
    problem, information = objective.problem, _nuisance_information(objective)
    comparable = comparable_channels(problem.actuator, problem.model)
    missing = tuple(name for name in comparable if name not in problem.measured)
    if not missing:
        return information
    channels = (*missing, *problem.channels)
    extended = replace(objective, problem=problem.observing(channels))
    jacobians = jacobians_at(extended, result.point, stream(seed, "Jacobians of further channels"))
    signals = extended.outputs(result.point[np.newaxis])[0, : extended.channel_rows]
    added = further_channels_information(
        dict(zip(channels, np.split(signals, len(channels)), strict=True)),
        dict(zip(channels, np.split(jacobians, len(channels), axis=2), strict=True)),
        problem.channels,
        # The noise of a signal that hardly varies is relative to the effect of faults on it.
        PRIOR_DEVIATION,
    )
    return information | added


def _nuisance_information(objective: MapObjective) -> dict[str, Array]:
    """Return the information (d, d) of the channels that measure a nuisance, by channel."""
    information = {}
    for i, name in enumerate(objective.space.coordinates):
        if name in KNOWN_BY:
            of_nuisance = np.zeros((objective.space.dimensions,) * 2)
            of_nuisance[i, i] = DEFAULT_SCATTER**-2
            information[KNOWN_BY[name]] = of_nuisance
    return information
