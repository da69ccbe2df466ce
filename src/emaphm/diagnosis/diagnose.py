"""From a recording to a diagnosis."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.diagnosis.identifiability import confidence
from emaphm.diagnosis.result import Diagnosis, NuisanceEstimate
from emaphm.diagnosis.verdict import HARDLY_KNOWN, estimates, is_explained
from emaphm.estimation.bias_correction import MOST_TURNS, assessed, has_reference
from emaphm.estimation.mcmc import check_posterior, sample
from emaphm.estimation.methods import method_named
from emaphm.estimation.nuisances import unit_of
from emaphm.estimation.objective import LEAST_MOTION, Fit
from emaphm.estimation.search import Found, check_fitness, fit_of, search
from emaphm.progress import Progress, subprogress
from emaphm.recording import Recording, check_plausible
from emaphm.simulation import REFERENCE, model_named
from emaphm.version import VERSION

SEARCHING = 0.1
"""Share of the time that the search takes where the posterior is sampled after it."""


def diagnose(
    recording: Recording,
    actuator: Actuator,
    *,
    method: str = "hybrid",
    model: str = "averaged",
    fitness: str = "least_squares",
    turns: int = MOST_TURNS,
    nuisances: Sequence[str] | None = None,
    seed: int = 0,
    workers: int | None = None,
    posterior: bool = False,
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
        What an optimiser minimises: one of `FITNESSES`; least squares where they follow.
    nuisances
        What is estimated with the faults by a method with least squares: names in
        `emaphm.estimation.nuisances.NAMES`, none where empty, the actuator's own where left out; then
        also what is off its description beyond doubt (`emaphm.diagnosis.nuisance_selection`).
        A recorded load or temperature counts as known. What the actuator's baseline leaves open is the
        unit's, not the recording's: a method with least squares estimates it whatever is named here.
    turns
        Most corrections of the model's bias by the reference model (with least squares, actuators with an
        electrical description, recordings up to 30 s); 0 turns them off.
    seed, workers
        The same seed gives the same bits, whatever the number of threads.
    posterior
        Whether to sample the posterior as well, which takes some seconds: see
        `emaphm.estimation.mcmc`. Values and verdicts stay those of the search.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    RecordingError
        The recording cannot be meant for this actuator, by orders of magnitude.
    MethodError
        A name is unknown, or fitness or model do not go with the method, or the model not with a posterior.
    """
    began = time.perf_counter()
    chosen = method_named(method)
    check_fitness(chosen, fitness)
    check_plausible(recording, actuator)
    fit = fit_of(recording, actuator, chosen, model_named(model), nuisances, workers)
    if posterior:
        check_posterior(fit.problem.model)
    searching = subprogress(on_progress, 0.0, SEARCHING if posterior else 1.0)
    found = search(
        fit,
        chosen,
        fitness=fitness,
        turns=turns,
        seed=seed,
        suspecting=nuisances is None,
        on_progress=searching,
    )
    if found.discrepancy is None and has_reference(fit.problem):
        found = _with_discrepancy(found)
    diagnosis = _conclude(found, chosen.name, fitness, seed, began)
    if not posterior:
        return diagnosis
    # As the reference model has it at the estimate itself, where that is known.
    correction = found.correction if found.discrepancy is None else found.discrepancy
    sampling = subprogress(on_progress, SEARCHING, 1.0)
    sampled = sample(found.fit, found.point, correction, diagnosis.covariance, seed, sampling)
    return replace(
        diagnosis,
        posterior=sampled,
        evaluations=diagnosis.evaluations + sampled.evaluations,
        seconds=time.perf_counter() - began,
    )


def _with_discrepancy(found: Found) -> Found:
    known = assessed(found.fit, found.point, found.fit.problem.by(REFERENCE))
    return replace(
        found,
        discrepancy=known.discrepancy,
        evaluations=found.evaluations + known.evaluations,
        reference_runs=found.reference_runs + known.reference_runs,
    )


def _conclude(found: Found, method: str, fitness: str, seed: int, began: float) -> Diagnosis:
    """Return the diagnosis at `found`."""
    fit, problem, space = found.fit, found.fit.problem, found.fit.space
    outputs = fit.outputs(found.point[np.newaxis])[0] + found.correction
    modelled = outputs[: problem.recording.samples]
    sure = confidence(found, fit.target - outputs, seed)
    moves, spent = _moves(fit, found.point)
    current = problem.recorded - modelled
    return Diagnosis(
        components=estimates(space, found.point, sure.covariance, sure.groups),
        coordinates=space.coordinates,
        covariance=sure.covariance,
        method=method,
        model=problem.model.name,
        fitness_name=fitness,
        fitness=found.fitness,
        residual_rms_A=float(np.sqrt(np.mean(current**2))),
        explained=is_explained(problem.recorded, current, corrected=bool(found.correction.any())),
        evaluations=found.evaluations + sure.evaluations + spent + 1,
        reference_runs=found.reference_runs,
        seconds=time.perf_counter() - began,
        seed=seed,
        recording=problem.recording.source,
        actuator=problem.actuator,
        version=VERSION,
        time_s=problem.recording["time_s"],
        recorded=problem.recorded,
        modelled=modelled,
        channels=problem.channels,
        nuisances=_nuisances(fit, found.point, sure.covariance),
        groups=sure.groups,
        suspected=found.suspected,
        moves=moves,
    )


def _moves(fit: Fit, point: Array) -> tuple[bool, int]:
    """Return whether the actuator moved, and the simulations spent.

    As its position was recorded, or else as the model at `point` (d,) has it.
    """
    recording, name = fit.problem.recording, "position_rad"
    if name in recording:
        position, spent = recording[name], 0
    else:
        seen = replace(fit, problem=replace(fit.problem, channels=(name,), weights=np.ones(1)))
        position, spent = seen.outputs(point[np.newaxis])[0, : recording.samples], 1
    return bool(np.ptp(position) > LEAST_MOTION * np.ptp(recording["command_rad"])), spent


def _nuisances(fit: Fit, point: Array, spread: Array) -> dict[str, NuisanceEstimate]:
    """Return what was estimated besides at `point` (d,), with standard errors from the covariance (d, d)."""
    unknown, first = fit.space.nuisances, len(fit.space.columns)
    values = fit.space.nuisance_values(point[np.newaxis])
    told = zip(values.items(), unknown.errors(spread[first:, first:]), unknown.deviations, strict=True)
    return {
        name: NuisanceEstimate(
            float(value[0]),
            float(error),
            unit_of(name, fit.problem.actuator.coordinates),
            bool(error < HARDLY_KNOWN * before),
        )
        for (name, value), error, before in told
    }
