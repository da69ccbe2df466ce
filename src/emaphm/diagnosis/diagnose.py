"""The diagnosis of one recording: search, selection of deviations, and conclusion."""

import time
from collections.abc import Sequence
from dataclasses import replace

from emaphm.actuator import Actuator
from emaphm.actuator.argument import check_actuator
from emaphm.blas_threads import one_blas_thread
from emaphm.diagnosis.conclusion import conclude
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.explanation.other_drive import other_drive
from emaphm.diagnosis.posing import objective_for, without_spoilt_rows
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.selection.description_errors import suspected_parameters
from emaphm.diagnosis.selection.deviations import select_deviations
from emaphm.diagnosis.selection.residual_share import notes_on_alternatives
from emaphm.diagnosis.selection.supply.supply_scan import with_requested_supply
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import MAX_CORRECTIONS, with_discrepancy
from emaphm.estimation.methods import WITH_LEAST_SQUARES, Method, method_named
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search import check_fitness, search
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.sensors.channel_swaps import with_channels_exchanged
from emaphm.estimation.starts import Starts
from emaphm.progress import Progress, subprogress
from emaphm.recording import Recording, check_plausible
from emaphm.recording.argument import check_recording
from emaphm.recording.sensor_checks import check_sensors
from emaphm.simulation import model_named

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
