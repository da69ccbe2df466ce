"""The diagnosis of one recording: search, corrections, tests and verdicts."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.argument import check_actuator
from emaphm.arrays import Array, rms
from emaphm.blas_threads import one_blas_thread
from emaphm.diagnosis.explanation.alternatives import with_alternatives
from emaphm.diagnosis.explanation.cautions import cautions
from emaphm.diagnosis.explanation.command_speed import with_command
from emaphm.diagnosis.explanation.moment import notes_on_moment
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.explanation.one_way import undecided_where_one_way
from emaphm.diagnosis.explanation.open_phases import undecided_between_phases
from emaphm.diagnosis.explanation.other_drive import other_drive
from emaphm.diagnosis.explanation.reasons import reasons_against
from emaphm.diagnosis.explanation.without_fault import tested_by_refits
from emaphm.diagnosis.identifiability import identifiability
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.selection.description_errors import suspected_parameters
from emaphm.diagnosis.selection.deviations import select_deviations
from emaphm.diagnosis.selection.residual_share import notes_on_alternatives
from emaphm.diagnosis.selection.supply.supply_scan import with_requested_supply
from emaphm.diagnosis.verdict import VERDICT, Estimate, estimates, undecided_by_model_error, unexplained
from emaphm.errors import MethodError, nearest
from emaphm.estimation.bias_correction import MAX_CORRECTIONS, over_all_phases, with_discrepancy
from emaphm.estimation.compared_channels import TORQUE_CURRENTS
from emaphm.estimation.methods import WITH_LEAST_SQUARES, Method, method_named
from emaphm.estimation.objective import MapObjective, faults_objective, faults_only_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.problem import Problem
from emaphm.estimation.rows.after_jumps import rows_after_jumps
from emaphm.estimation.rows.means import masks_of_means, over_swings
from emaphm.estimation.search import check_fitness, search
from emaphm.estimation.search_result import SMALLEST_SHARE, SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.sensors.channel_swaps import with_channels_exchanged
from emaphm.estimation.space.nuisances import unit_of
from emaphm.estimation.starts import Starts
from emaphm.estimation.uncertainty.local_covariance import jacobians_of
from emaphm.estimation.uncertainty.model_error import HealthyComparison, compared_with_healthy
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import stream
from emaphm.recording import Recording, check_plausible
from emaphm.recording.argument import check_recording
from emaphm.recording.schema import SCHEMA
from emaphm.recording.sensor_checks import CheckedRecording, check_sensors
from emaphm.simulation import Model, model_named
from emaphm.version import VERSION

SAMPLING_SHARE = 0.9
"""Share of the progress bar for the sampling of the posterior, where it is requested."""

SEARCH_SHARE = 0.2
"""Share of the remaining progress bar for the first search, where a search for deviations from the
description follows: about its share of the time if it does not explain the recording."""


@one_blas_thread()
def diagnose(
    recording: Recording,
    actuator: Actuator,
    *,
    method: str = "hybrid",
    model: str = "averaged",
    fitness: str = "least_squares",
    max_corrections: int = MAX_CORRECTIONS,
    nuisances: Sequence[str] | None = None,
    seed: int = 0,
    workers: int | None = None,
    posterior: bool = False,
    starts: Starts | None = None,
    on_progress: Progress | None = None,
) -> Diagnosis:
    """Return the faults of `actuator` that explain `recording`, with their uncertainty.

    Parameters
    ----------
    method
        "hybrid" (space-filling starts, damped least squares, bias correction); an optimiser by name or
        abbreviation, at its published settings; or such a name with "+lsq": the optimiser then finds the
        starting points of the least squares. See `emaphm.estimation.methods`.
    model
        The model that is fitted to the recording: "averaged"; an optimiser alone may also use "monitor" or
        the slow "reference".
    fitness
        Cost function of an optimiser, one of `COST_FUNCTIONS`; "least_squares" if least squares follow.
    max_corrections
        Largest number of corrections of the model's bias by the reference model (with least squares,
        actuators with an electrical description, recordings up to 60 s); 0 turns them off.
    nuisances
        Nuisances that a method with least squares estimates with the faults: names in
        `emaphm.estimation.space.nuisances.NAMES`; none if empty. By default, the nuisances of the actuator's
        description, and nuisances that deviate significantly from it
        (`emaphm.diagnosis.selection.nuisance_selection`). A recorded load or temperature counts as known.
        Parameters of the unit that its baseline leaves open are always estimated.
    seed, workers
        Seed of the random numbers, and number of threads. The result depends on the seed only, bit by bit.
    posterior
        Whether to sample the posterior in addition. This takes 60,000 to 130,000 simulations, at most some
        260,000; a search takes 2,000 to 4,000. See `emaphm.estimation.posterior.mcmc`. Values and verdicts
        remain those of the search.
    starts
        Starting points of the least squares, instead of a global search. If the estimate from these points
        does not explain the recording, the whole range is searched, and a note states this.
    on_progress
        Called with the completed fraction, from 0 to 1.

    Raises
    ------
    RecordingError
        `recording` is no `Recording`, or its values differ from this actuator's by orders of magnitude.
    ActuatorError
        `actuator` is no `Actuator`.
    MethodError
        The recording has no current that can be compared with the model; a name is unknown; the method does
        not support the fitness or the model; or the model does not support a posterior.
    """
    began = time.perf_counter()
    check_recording(recording)
    check_actuator(actuator)
    settings = SearchSettings(method_named(method), max_corrections, seed)
    check_fitness(settings.method, fitness)
    if max_corrections < 0:
        raise MethodError(f"max_corrections={max_corrections} is no number of corrections; give 0 or more")
    check_plausible(recording, actuator)
    checked = with_channels_exchanged(check_sensors(recording, actuator), actuator, model_named(model))
    objective = objective_for(
        checked.recording, actuator, settings.method, model_named(model), nuisances, workers
    )
    objective = without_spoilt_rows(objective, checked)
    if posterior:
        from emaphm.estimation.posterior.mcmc import check_posterior

        check_posterior(objective.problem.model)
    diagnosis, result = _searched(
        objective,
        checked.recording,
        settings,
        fitness,
        starts,
        subprogress(on_progress, 0.0, 1 - SAMPLING_SHARE if posterior else 1.0),
        deviations=nuisances is None,
    )
    diagnosis = diagnosis.with_sensor_faults(checked.findings)
    if posterior:
        sampling_progress = subprogress(on_progress, 1 - SAMPLING_SHARE, 1.0)
        diagnosis = _with_posterior(diagnosis, result, seed, sampling_progress)
    if on_progress:
        on_progress(1.0)
    evaluations, reference_runs = result.objective.problem.runs.of(result.objective.problem.model)
    return replace(
        diagnosis,
        evaluations=evaluations,
        reference_runs=reference_runs,
        seconds=time.perf_counter() - began,
    )


def _searched(
    objective: MapObjective,
    recording: Recording,
    settings: SearchSettings,
    fitness: str,
    starts: Starts | None,
    on_progress: Progress | None,
    *,
    deviations: bool,
) -> tuple[Diagnosis, SearchResult]:
    """Return the diagnosis that a search leads to, and the estimate behind it.

    With `deviations`, these from the description are estimated if the search corrects the bias of the model.
    """
    deviations = deviations and settings.method.least_squares and settings.max_corrections > 0
    result = search(
        objective,
        settings,
        fitness=fitness,
        on_progress=subprogress(on_progress, 0.0, SEARCH_SHARE if deviations else 1.0),
        starts=None if starts is None else starts.of(objective.space),
    )
    name, notes = _searched_by(settings.method, starts, result)
    recording = recording.with_channels(recording.channels, notes) if notes else recording
    if settings.method.least_squares and result.discrepancy is not None:
        result = with_requested_supply(result, settings)
        if deviations:
            rest = subprogress(on_progress, SEARCH_SHARE, 1.0)
            return _with_deviations(result, recording, name, settings, rest)
    result = with_discrepancy(result, settings.seed)
    return conclude(result, recording, name, fitness, settings.seed), result


def _with_deviations(
    searched: SearchResult,
    recording: Recording,
    name: str,
    settings: SearchSettings,
    on_progress: Progress | None,
) -> tuple[Diagnosis, SearchResult]:
    """Return the diagnosis with the selected deviations from the description, and its estimate."""
    moves = moves_at(searched.objective, searched.point)
    selection = select_deviations(searched, settings, moves=moves, on_progress=on_progress)
    estimate = with_discrepancy(selection.result, settings.seed)
    concluded = conclude(estimate, recording, name, "least_squares", settings.seed)
    notes = notes_on_alternatives(estimate) if concluded.explained else ()
    diagnosis = replace(
        concluded,
        selected=(*selection.nuisances, *suspected_parameters(estimate)),
        recording_notes=(*concluded.recording_notes, *notes),
    ).with_laws(selection.laws)
    if moves and not diagnosis.explained:
        drives = other_drive(searched, estimate, settings)
        diagnosis = replace(diagnosis, reasons=(*drives, *diagnosis.reasons))
    return diagnosis, estimate


def _with_posterior(
    diagnosis: Diagnosis, result: SearchResult, seed: int, on_progress: Progress | None
) -> Diagnosis:
    """Return the `diagnosis` of `result` with samples of the posterior."""
    from emaphm.estimation.posterior.mcmc import sample

    correction, covariance = result.outputs_correction, diagnosis.covariance
    samples = sample(result.objective, result.point, correction, covariance, seed, on_progress)
    return replace(diagnosis, posterior=samples)


def _searched_by(method: Method, starts: Starts | None, result: SearchResult) -> tuple[str, tuple[str, ...]]:
    """Return the name of the method that found the result, and notes on the search."""
    if starts is None:
        return method.name, ()
    if result.started:
        return f"{starts.method}{WITH_LEAST_SQUARES}", ()
    failure = f"least squares from the answer of the {starts.method} do not explain the recording"
    return method.name, (f"{failure}; all of the range was searched",)


def without_spoilt_rows(objective: MapObjective, checked: CheckedRecording) -> MapObjective:
    """Return the objective of a checked recording without the rows that the checks found unusable."""
    return objective.ignoring(masks_of_means(checked.unusable, objective.problem))


def objective_for(
    recording: Recording,
    actuator: Actuator,
    method: Method,
    model: Model,
    nuisances: Sequence[str] | None,
    workers: int | None,
    *,
    below_healthy: bool = True,
) -> MapObjective:
    """Return the objective that `method` minimises on a recording.

    With least squares, this is the residual of all channels, with faults and nuisances as parameters. Rows
    right after a jump of the command are omitted where they depend on the exact instant of the jump. Without
    `below_healthy`, the friction has a lower bound at its healthy value. Without least squares, this is the
    residual of the current, with only the faults as parameters, in [0, 1].

    Raises
    ------
    MethodError
        A nuisance is unknown, or needs an electrical description that the actuator lacks; or the method
        estimates no nuisances.
    """
    problem = problem_of(recording, actuator, model, workers, None if method.least_squares else ())
    _check_current(problem, recording)
    if method.least_squares:
        problem = over_swings(problem)
        objective = faults_objective(problem, nuisances, below_healthy=below_healthy)
        return objective.ignoring(rows_after_jumps(problem))
    if nuisances:
        raise MethodError(
            f"method '{method.name}' estimates faults alone; leave out nuisance '{nuisances[0]}', or use "
            f"'{method.name}+lsq'"
        )
    return faults_only_objective(problem)


def _check_current(problem: Problem, recording: Recording) -> None:
    """Refuse a recording without a current: no other channel identifies faults of windings and magnets."""
    if problem.primary in TORQUE_CURRENTS:
        return
    others = [name for name in recording if name not in SCHEMA]
    hint = nearest("current_A", others, "columns not used") if others else ""
    raise MethodError(
        f"{recording.source}: a diagnosis of all faults needs a current, and there is only "
        f"{', '.join(problem.channels)}{hint}; record current_A, or the three phases with angle_rad, or "
        "name it under [channels] in the actuator's TOML (replay and calibrate do without)"
    )


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
