"""From a recording to a diagnosis."""

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
from emaphm.diagnosis.selection.supply.supply_scan import with_asked_supply
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
"""Part of the whole progress bar that sampling the posterior fills."""

SEARCH_SHARE = 0.2
"""Part of the rest that the first search fills where deviations from the description are looked for after
it: about the time that it takes where it does not explain the recording."""


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
        abbreviation, at its published settings; or such a name with "+lsq", to have it find the starts
        of the least squares: see `emaphm.estimation.methods`.
    model
        What reproduces the recording: "averaged"; an optimiser alone may also use "monitor", or
        "reference", slowly.
    fitness
        What an optimiser minimises: one of `COST_FUNCTIONS`; least squares where they follow.
    max_corrections
        Most corrections of the model's bias by the reference model (with least squares, actuators with an
        electrical description, recordings up to 60 s); 0 turns them off.
    nuisances
        What a method with least squares estimates with the faults: names in
        `emaphm.estimation.space.nuisances.NAMES`; none where empty. Where left out, it estimates those of the
        actuator's description, and those that deviate significantly from it
        (`emaphm.diagnosis.selection.nuisance_selection`). A recorded load or temperature counts as known.
        Parameters of the unit that its baseline leaves open are estimated whatever is named here.
    seed, workers
        The same seed gives the same bits, whatever the number of threads.
    posterior
        Whether to sample the posterior as well, by 60,000 to 130,000 simulations, at most some 260,000, where
        a search takes 2,000 to 4,000: see `emaphm.estimation.posterior.mcmc`. Values and verdicts stay those
        of the search.
    starts
        Where least squares begin, in place of a global search. If they do not explain the recording from
        there, the whole range is searched after all, and a note says so.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    RecordingError
        `recording` is no `Recording`, or its values are orders of magnitude away from this actuator's.
    ActuatorError
        `actuator` is no `Actuator`.
    MethodError
        The recording has no current that the model can be compared in; a name is unknown, or fitness or
        model do not go with the method, or the model not with a posterior.
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
        sampling = subprogress(on_progress, 1 - SAMPLING_SHARE, 1.0)
        diagnosis = _with_posterior(diagnosis, result, seed, sampling)
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

    With `deviations`, those from the description are looked for where the search corrects the model's bias.
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
        result = with_asked_supply(result, settings)
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
    """Return the diagnosis that allows for deviations from the description, and the estimate behind it."""
    moves = moves_at(searched.objective, searched.point)
    selection = select_deviations(searched, settings, moves=moves, on_progress=on_progress)
    found = with_discrepancy(selection.result, settings.seed)
    concluded = conclude(found, recording, name, "least_squares", settings.seed)
    notes = notes_on_alternatives(found) if concluded.explained else ()
    diagnosis = replace(
        concluded,
        selected=(*selection.nuisances, *suspected_parameters(found)),
        recording_notes=(*concluded.recording_notes, *notes),
    ).with_laws(selection.laws)
    if moves and not diagnosis.explained:
        drives = other_drive(searched, found, settings)
        diagnosis = replace(diagnosis, reasons=(*drives, *diagnosis.reasons))
    return diagnosis, found


def _with_posterior(
    diagnosis: Diagnosis, result: SearchResult, seed: int, on_progress: Progress | None
) -> Diagnosis:
    """Return the `diagnosis` at `result` with samples of the posterior."""
    from emaphm.estimation.posterior.mcmc import sample

    correction, covariance = result.outputs_correction, diagnosis.covariance
    samples = sample(result.objective, result.point, correction, covariance, seed, on_progress)
    return replace(diagnosis, posterior=samples)


def _searched_by(method: Method, starts: Starts | None, result: SearchResult) -> tuple[str, tuple[str, ...]]:
    """Return the name of the method that has led to the result, and notes on how it came about."""
    if starts is None:
        return method.name, ()
    if result.started:
        return f"{starts.method}{WITH_LEAST_SQUARES}", ()
    astray = f"least squares from the answer of the {starts.method} do not explain it"
    return method.name, (f"{astray}; all of the range was searched",)


def without_spoilt_rows(objective: MapObjective, checked: CheckedRecording) -> MapObjective:
    """Return the objective of a checked recording without its spoilt rows."""
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
    """Return what `method` minimises on a recording.

    With least squares, it is the residual of every channel, with faults and nuisances as parameters. Rows
    right after a jump of the command are left out where the exact moment of the jump matters. Without
    `below_healthy`, the friction is not below healthy. Without least squares, it is the residual of the
    current, with the faults alone as parameters, in [0, 1].

    Raises
    ------
    MethodError
        A nuisance is unknown, or needs the electrical description that the actuator lacks; or the method
        estimates none.
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
    """Refuse a recording without a current: windings and magnets show in nothing else well enough."""
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
    """Return the diagnosis at `result`; its counts and time are still to be filled in.

    Without `tests`, the verdicts are those of the intervals.
    """
    objective, problem, space = result.objective, result.objective.problem, result.objective.space
    jacobians = jacobians_of(result, stream(seed, "Jacobians of the covariance"))
    moves = moves_at(objective, result.point)
    healthy, reasons = _explanation(result, jacobians, seed, moves=moves)
    of_all_phases = over_all_phases(result, seed) if reasons else result
    if of_all_phases is not result:
        healthy_there, reasons_there = _explanation(of_all_phases, jacobians, seed, moves=moves)
        if not reasons_there:
            result, healthy, reasons = of_all_phases, healthy_there, reasons_there
    residual = result.fitted_residual[: problem.samples]
    known = identifiability(replace(result, jacobians=jacobians), seed, explained=not reasons)
    components = estimates(space, result.point, known.covariance, known.collinear_sets)
    if reasons:
        components = unexplained(components, space.fixed)
        reasons = with_command((*reasons, *notes_on_moment(result)), problem)
    elif tests:
        components = tested(components, result, jacobians, seed)
    components = undecided_by_model_error(components, known.model_error_share, space)
    return Diagnosis(
        components=components,
        coordinates=space.coordinates,
        covariance=known.covariance,
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
        nuisances=nuisance_estimates(objective, result.point, known.covariance),
        collinear_sets=known.collinear_sets,
        moves=moves,
        model_error=healthy,
        reasons=reasons,
    )


def tested(
    components: Mapping[str, Estimate], result: SearchResult, jacobians: Array, seed: int
) -> dict[str, Estimate]:
    """Return the `components` at `result`, undecided where something else explains the recording as well.

    `jacobians` (n, d, channel rows) are those of the channels there.
    """
    components = with_alternatives(components, result, jacobians, seed)
    components = tested_by_refits(components, result, jacobians, seed)
    components = undecided_where_one_way(components, result)
    return undecided_between_phases(components, result)


def _explanation(
    result: SearchResult, jacobians: Array, seed: int, *, moves: bool
) -> tuple[Mapping[str, HealthyComparison], tuple[str, ...]]:
    """Return the residuals compared with healthy recordings', and the reasons against the estimate."""
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
            name in nuisances.located or bool(error < VERDICT.uninformative * before),
        )
        for (name, value), error, before in zip(
            values.items(), errors, nuisances.prior_deviations, strict=True
        )
    }
