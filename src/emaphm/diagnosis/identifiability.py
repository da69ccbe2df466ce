"""How well an estimate is known, and what of it is identifiable only in combination."""

from dataclasses import dataclass, replace

import numpy as np

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

    Of each variance, `model_error_share` (d,) is what the model's error adds that a calibration has learned.
    """

    covariance: Array
    collinear_sets: tuple[CollinearSet, ...]
    model_error_share: Array


def identifiability(result: SearchResult, seed: int, *, explained: bool = True) -> Identifiability:
    """Return how well the estimate of `result` is known.

    The covariance is that of the data and the optimiser's scatter, and of the faults that healthy recordings
    seem to have where a calibration has learned them. Where the recording is not `explained`, it includes an
    error that is as large as the residual and looks like a parameter, and is inflated by the normalised
    residual; and always it includes the spread of alternatives that fit as well, and of slow motions what
    switching alone makes of an estimate (`switching_errors`). Where the search has not converged, or motion
    is slow (`response_of`), a Gauss-Newton step remains: towards the optimum that a population method may not
    have reached, and for the model's discrepancy not yet corrected. The covariance then includes its square,
    and that of how far another command behind slow rows would move the estimate.
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
    """Return the sets of which only a combination is identifiable, by the `covariance` (d, d) at `result`.

    Sets of nuisances alone are left out, and components that are known well enough all the same.
    """
    space = result.objective.space
    faults, names = len(space.columns), space.coordinates
    half_widths = Z95 * np.sqrt(np.diag(covariance))
    chosen: dict[tuple[str, ...], list[int]] = {}
    for members in collinear_coordinates(covariance):
        matter = [i for i in members if i >= faults or half_widths[i] > VERDICT.healthy_margin]
        called = tuple(dict.fromkeys(_parameter_name(names[i]) for i in matter))
        if len(called) > 1 and matter[0] < faults:
            chosen[called] = matter
    if not chosen:
        return ()
    further = further_information(result, seed)
    channels = result.objective.problem.channels
    return tuple(
        CollinearSet(called, channels, resolving_channels(covariance, members, further))
        for called, members in chosen.items()
    )


def _parameter_name(coordinate: str) -> str:
    """Return what a coordinate belongs to: the eccentricity has two of them, the baseline several."""
    if coordinate.startswith(BASELINE):
        name = coordinate.removeprefix(BASELINE)
        return "the baseline" if name.isdigit() else f"the unit's {name}"
    return coordinate.removesuffix("_x").removesuffix("_y")


def further_information(result: SearchResult, seed: int) -> dict[str, Array]:
    """Return the information (d, d) that each channel that was not recorded would add, by its name."""
    objective = result.objective
    problem, information = objective.problem, _of_known_nuisances(objective)
    comparable = comparable_channels(problem.actuator, problem.model)
    missing = tuple(name for name in comparable if name not in problem.measured)
    if not missing:
        return information
    channels = (*missing, *problem.channels)
    other = replace(objective, problem=problem.observing(channels))
    jacobians = jacobians_at(other, result.point, stream(seed, "Jacobians of further channels"))
    signals = other.outputs(result.point[np.newaxis])[0, : other.channel_rows]
    further = further_channels_information(
        dict(zip(channels, np.split(signals, len(channels)), strict=True)),
        dict(zip(channels, np.split(jacobians, len(channels), axis=2), strict=True)),
        problem.channels,
        # Of a signal that hardly varies, the size is that of the faults' effect on it.
        PRIOR_DEVIATION,
    )
    return information | further


def _of_known_nuisances(objective: MapObjective) -> dict[str, Array]:
    """Return the information (d, d) of channels that would make a nuisance known."""
    information = {}
    for i, name in enumerate(objective.space.coordinates):
        if name in KNOWN_BY:
            known = np.zeros((objective.space.dimensions,) * 2)
            known[i, i] = DEFAULT_SCATTER**-2
            information[KNOWN_BY[name]] = known
    return information
