"""The conclusion from an estimate: verdicts, tests of other explanations, and reasons against it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array, rms
from emaphm.diagnosis.explanation.alternatives import with_alternatives
from emaphm.diagnosis.explanation.cautions import cautions
from emaphm.diagnosis.explanation.command_speed import with_command
from emaphm.diagnosis.explanation.moment import notes_on_moment
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.explanation.one_way import undecided_where_one_way
from emaphm.diagnosis.explanation.open_phases import undecided_between_phases
from emaphm.diagnosis.explanation.reasons import reasons_against
from emaphm.diagnosis.explanation.without_fault import tested_by_refits
from emaphm.diagnosis.identifiability import identifiability
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import VERDICT, Estimate, estimates, undecided_by_model_error, unexplained
from emaphm.estimation.bias_correction import over_all_phases
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SMALLEST_SHARE, SearchResult
from emaphm.estimation.space.nuisances import unit_of
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.estimation.uncertainty.model_error import HealthyComparison, compared_with_healthy
from emaphm.random_streams import stream
from emaphm.recording import Recording
from emaphm.version import VERSION


def conclude(
    result: SearchResult,
    recording: Recording,
    method: str,
    fitness: str,
    seed: int,
    *,
    tests: bool = True,
) -> Diagnosis:
    """Return the diagnosis of `result`, with its numbers of simulations and its time still 0.

    With `tests=False`, the verdicts are those of the intervals alone.
    """
    objective, problem, space = result.objective, result.objective.problem, result.objective.space
    jacobians = jacobians_of(result, stream(seed, "Jacobians of the covariance"))
    moves = moves_at(objective, result.point)
    healthy, reasons = _explanation(result, jacobians, seed, moves=moves)
    all_phases = over_all_phases(result, seed) if reasons else result
    if all_phases is not result:
        all_phases_healthy, all_phases_reasons = _explanation(all_phases, jacobians, seed, moves=moves)
        if not all_phases_reasons:
            result, healthy, reasons = all_phases, all_phases_healthy, all_phases_reasons
    residual = result.fitted_residual[: problem.samples]
    uncertainty = identifiability(replace(result, jacobians=jacobians), seed, explained=not reasons)
    components = estimates(space, result.point, uncertainty.covariance, uncertainty.collinear_sets)
    if reasons:
        components = unexplained(components, space.fixed)
        reasons = with_command((*reasons, *notes_on_moment(result)), problem)
    elif tests:
        components = tested(components, result, jacobians, seed)
    components = undecided_by_model_error(components, uncertainty.model_error_share, space)
    return Diagnosis(
        components=components,
        coordinates=space.coordinates,
        covariance=uncertainty.covariance,
        method=method,
        model=problem.model.name,
        fitness_name=fitness,
        fitness=result.cost,
        residual_rms_A=rms(result.compared_residual),
        explained=not reasons,
        evaluations=0,
        reference_runs=0,
        seconds=0.0,
        seed=seed,
        recording=recording.source,
        actuator=problem.actuator,
        version=VERSION,
        time_s=recording["time_s"][0] + problem.inputs.time_s,
        recorded=problem.recorded,
        modelled=problem.recorded - residual,
        channels=problem.channels,
        recording_notes=(*recording.notes, *cautions(components, result, moves=moves)),
        nuisances=nuisance_estimates(objective, result.point, uncertainty.covariance),
        collinear_sets=uncertainty.collinear_sets,
        moves=moves,
        model_error=healthy,
        reasons=reasons,
    )


def tested(
    components: Mapping[str, Estimate], result: SearchResult, jacobians: Array, seed: int
) -> dict[str, Estimate]:
    """Return the `components` of `result`; those with an equally good other explanation are undecided.

    `jacobians` (n, d, channel rows) are those of the channels at the estimate.
    """
    components = with_alternatives(components, result, jacobians, seed)
    components = tested_by_refits(components, result, jacobians, seed)
    components = undecided_where_one_way(components, result)
    return undecided_between_phases(components, result)


def _explanation(
    result: SearchResult, jacobians: Array, seed: int, *, moves: bool
) -> tuple[Mapping[str, HealthyComparison], tuple[str, ...]]:
    """Return the comparison of residuals with healthy recordings, and the reasons against the estimate."""
    healthy = compared_with_healthy(
        result.objective.problem,
        result.residual_by_channel,
        least_share=SMALLEST_SHARE,
        switching=result.switching_variances,
    )
    return healthy, reasons_against(result, jacobians, healthy, seed, moves=moves)


def nuisance_estimates(
    objective: MapObjective, point: Array, covariance: Array
) -> dict[str, NuisanceEstimate]:
    """Return the nuisances at `point` (d,), with standard errors from the `covariance` (d, d)."""
    nuisances, first = objective.space.nuisances, len(objective.space.columns)
    values = objective.space.nuisance_values(point[np.newaxis])
    errors = nuisances.standard_errors(covariance[first:, first:])
    return {
        name: NuisanceEstimate(
            float(value[0]),
            float(error),
            unit_of(name, objective.problem.actuator.coordinates),
            name in nuisances.located or bool(error < VERDICT.uninformative * prior_deviation),
        )
        for (name, value), error, prior_deviation in zip(
            values.items(), errors, nuisances.prior_deviations, strict=True
        )
    }
