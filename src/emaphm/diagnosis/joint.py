"""From several recordings of one unit to one diagnosis: common faults, and what is each recording's own.

Each recording is searched by itself first. That gives the starts of the joint fit, the nuisances that
deviate significantly in any of them, and the estimates that are compared for contradictions.
"""

import time
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from emaphm.actuator import NAMES, Actuator
from emaphm.arrays import Array
from emaphm.diagnosis.diagnose import conclude, objective_for
from emaphm.diagnosis.identifiability import collinear_sets, identifiability
from emaphm.diagnosis.joint_result import JointDiagnosis, JointRecording
from emaphm.diagnosis.nuisance_selection import select_nuisances, with_nuisances
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import Estimate, estimates, unexplained
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import MAX_CORRECTIONS, correct_bias, with_discrepancy
from emaphm.estimation.joint.contradictions import contradictions, dissenting
from emaphm.estimation.joint.correction import JointEstimate, corrected_estimate
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates, JointUncertainty, joint_uncertainty
from emaphm.estimation.levenberg_marquardt import descend
from emaphm.estimation.methods import method_named
from emaphm.estimation.multistart import MULTISTART
from emaphm.estimation.objective import CORRELATED_ROWS
from emaphm.estimation.problem import rms
from emaphm.estimation.search import search
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import child_seed, stream
from emaphm.recording import Recording, check_plausible
from emaphm.simulation import AVERAGED

STARTS = 3
"""Points that the joint descent begins at: the best of what the recordings alone ask for, and their mean."""

ALONE_SHARE = 0.6
"""Share of the time that the searches of single recordings take."""

METHOD = "hybrid"
"""How each recording is searched by itself."""

CONTRADICTED = "the recordings contradict each other"


def diagnose_joint(
    recordings: Sequence[Recording],
    actuator: Actuator,
    *,
    nuisances: Sequence[str] | None = None,
    max_corrections: int = MAX_CORRECTIONS,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> JointDiagnosis:
    """Return the faults of one unit that explain all its `recordings`, with their uncertainty.

    The faults and the deviations from the actuator's baseline are common; nuisances, such as load and
    temperature, are each recording's own, as are the channels. Where recordings scatter by more than their
    errors, the covariance includes it; where they contradict each other, no component is called healthy or
    degraded, and those that contradict the others are named.

    Parameters
    ----------
    nuisances, max_corrections, seed, workers, on_progress
        As for `emaphm.diagnose`. What deviates significantly from the description in one recording is
        estimated of all. Laws that the description lacks are not looked for.

    Raises
    ------
    MethodError
        There is no recording, they are of different units, one has no current, or a nuisance is unknown.
    RecordingError
        A recording cannot be of this actuator, by orders of magnitude.
    """
    began = time.perf_counter()
    _check(recordings, actuator)
    alone, selected = _alone(
        recordings,
        actuator,
        nuisances,
        max_corrections,
        seed,
        workers,
        subprogress(on_progress, 0.0, ALONE_SHARE),
    )
    joint, point = _fitted(alone, workers)
    if max_corrections:
        joint = joint.corrected([np.zeros_like(term.correction) for term in joint.terms])
    correcting = subprogress(on_progress, ALONE_SHARE, 0.95)
    estimate = corrected_estimate(joint, point, max_corrections, seed, correcting)
    known = joint_uncertainty(
        estimate, seed, alone=_alone_estimates(alone, joint, seed) if estimate.corrected else None
    )
    results = [with_discrepancy(one, seed) for one in _by_recording(estimate, known.point)]
    single = [
        conclude(result, recording, METHOD, "least_squares", seed)
        for result, recording in zip(results, recordings, strict=True)
    ]
    whole = _merged(alone, results, single, estimate, known, seed)
    models = [one.objective.problem.runs.of(AVERAGED) for one in results]
    return replace(
        whole,
        selected=selected,
        evaluations=sum(run for run, _ in models),
        reference_runs=sum(run for _, run in models),
        seconds=time.perf_counter() - began,
    )


def _check(recordings: Sequence[Recording], actuator: Actuator) -> None:
    """Refuse recordings that cannot be of one unit, before the work."""
    if not recordings:
        raise MethodError("no recording to diagnose; give those of one unit")
    serials = {str(one): recording for recording in recordings if (one := _serial(recording)) is not None}
    if len(serials) > 1:
        (first, one), (second, other) = list(serials.items())[:2]
        raise MethodError(
            f"{other.source} is of unit '{second}', {one.source} of unit '{first}'; a joint estimate is of "
            "one unit: leave the others out, or diagnose without --joint"
        )
    for recording in recordings:
        check_plausible(recording, actuator)


def _serial(recording: Recording) -> object:
    """Return the unit's serial number, None where the recording carries none."""
    return getattr(recording, "labels", {}).get("serial")


def _alone(
    recordings: Sequence[Recording],
    actuator: Actuator,
    nuisances: Sequence[str] | None,
    max_corrections: int,
    seed: int,
    workers: int | None,
    on_progress: Progress | None,
) -> tuple[list[SearchResult], tuple[str, ...]]:
    """Return where the search of each recording alone ends, and the nuisances selected in any of them."""
    method, found = method_named(METHOD), list[tuple[SearchResult, tuple[str, ...]]]()
    for r, recording in enumerate(recordings):
        objective = objective_for(recording, actuator, method, AVERAGED, nuisances, workers)
        # The first one's streams are those of a diagnosis of it alone.
        own = seed if r == 0 else child_seed(seed, "recording", r)
        result = search(objective, method, fitness="least_squares", max_corrections=max_corrections, seed=own)
        asked = nuisances is None and result.discrepancy is not None
        found.append(select_nuisances(result, max_corrections, own) if asked else (result, ()))
        if on_progress:
            on_progress((r + 1) / len(recordings))
    selected = tuple(dict.fromkeys(name for _, names in found for name in names))
    return [_with_all(result, names, selected, max_corrections, seed) for result, names in found], selected


def _with_all(
    result: SearchResult, names: tuple[str, ...], selected: tuple[str, ...], max_corrections: int, seed: int
) -> SearchResult:
    """Return the result with the nuisances `selected` in any recording estimated of this one too."""
    problem, estimated = result.objective.problem, result.objective.space.nuisances
    possible = estimated.others(problem.actuator, tuple(problem.measured))
    more = tuple(name for name in selected if name not in names and name in possible)
    if not more:
        return result
    objective, point = with_nuisances(result, names, more)
    child = child_seed(seed, "nuisances of other recordings")
    return correct_bias(objective, point[np.newaxis], max_corrections, child)


def _fitted(alone: Sequence[SearchResult], workers: int | None) -> tuple[JointObjective, Array]:
    """Return the joint objective, corrected as each recording alone is, and where its descent ends (d,)."""
    space = alone[0].objective.space
    unit = space.nuisances.unit
    shared = len(space.columns) + unit.priors.size
    terms = tuple(RecordingTerm(one.objective, shared, one.outputs_correction) for one in alone)
    joint = JointObjective(terms, unit, MULTISTART.fine.step, workers)
    point = np.zeros(joint.box.lower.size)
    for index, one in zip(joint.indices, alone, strict=True):
        point[index] = one.point
    starts = np.tile(point, (len(alone) + 1, 1))
    asked = np.array([one.point[term.shared_places] for one, term in zip(alone, terms, strict=True)])
    starts[:, : joint.shared] = [*asked, asked.mean(axis=0)]
    costs = np.array([one.cost for one in joint.evaluate(joint.box.project(starts))])
    best = np.argsort(costs, kind="stable")[:STARTS]
    return joint, descend(joint, starts[best], joint.box, MULTISTART.fine).best


def _alone_estimates(
    alone: Sequence[SearchResult], joint: JointObjective, seed: int
) -> AloneEstimates | None:
    """Return what each recording alone asks for; None of one recording."""
    if len(alone) == 1:
        return None
    places = [term.shared_places for term in joint.terms]
    points = np.array([one.point[at] for one, at in zip(alone, places, strict=True)])
    covariances = np.array(
        [identifiability(one, seed).covariance[np.ix_(at, at)] for one, at in zip(alone, places, strict=True)]
    )
    meta = random_effects(points, covariances, joint.prior_deviations[: joint.shared])
    return AloneEstimates(points, covariances, np.ones(len(alone)), meta)


def _by_recording(estimate: JointEstimate, point: Array) -> list[SearchResult]:
    """Return the joint estimate as each recording's own result, with its discrepancy."""
    joint, corrected = estimate.joint, estimate.corrected
    return [
        SearchResult.at(
            term.objective,
            joint.local(r, point),
            correction=known.mean if corrected else term.correction,
            discrepancy=known if corrected else None,
        )
        for r, (term, known) in enumerate(zip(joint.terms, estimate.discrepancies, strict=True))
    ]


def _merged(
    alone: Sequence[SearchResult],
    results: Sequence[SearchResult],
    single: Sequence[Diagnosis],
    estimate: JointEstimate,
    known: JointUncertainty,
    seed: int,
) -> JointDiagnosis:
    """Return the diagnosis of the unit; `single` are the recordings' own at the common faults."""
    joint, count = estimate.joint, len(results)
    priors = joint.prior_deviations[: joint.shared]
    covariance = known.covariance + estimate.scatter
    if not estimate.corrected:
        bias = _bias(joint, results, known.point, seed)
        covariance = covariance + np.outer(bias, bias)
    contradicted, named = np.zeros(joint.shared, bool), np.zeros(count, bool)
    if known.alone is not None:
        between = contradictions(known.alone, priors)
        contradicted, named = between.contradicted, dissenting(known.alone, priors)
        # The mean of recordings that scatter is known the better the more they are; what they contradict
        # each other in may be any of theirs.
        scatter = between.covariance / (1 if contradicted.any() or named.any() else count)
        covariance[: joint.shared, : joint.shared] += scatter
    local = covariance[np.ix_(joint.indices[0], joint.indices[0])]
    sets = collinear_sets(results[0], local, seed)
    agree = not (contradicted.any() or named.any())
    components = estimates(results[0].objective.space, results[0].point, local, sets)
    if not all(one.explained for one in single):
        components = unexplained(components)
    elif not agree:
        components = {name: _undecided(one) for name, one in components.items()}
    parts = [
        _recording(one, *pair, contradicts=bool(flag))
        for one, pair, flag in zip(single, zip(alone, results, strict=True), named, strict=True)
    ]
    first = single[0]
    kept = {field.name: getattr(first, field.name) for field in fields(first)}
    coordinates = results[0].objective.space.coordinates
    shared = [coordinates[i] for i in joint.terms[0].shared_places]
    residual = np.concatenate([one.recorded - one.modelled for one in single])
    channels = tuple(dict.fromkeys(name for one in single for name in one.channels))
    return JointDiagnosis(
        **kept
        | {
            "components": components,
            "coordinates": tuple(shared),
            "covariance": covariance[: joint.shared, : joint.shared],
            "fitness": float(np.mean(residual**2)),
            "residual_rms_A": rms(residual),
            "explained": agree and all(one.explained for one in single),
            "recording": ", ".join(one.recording for one in single),
            "time_s": _end_to_end([one.time_s for one in single]),
            "recorded": np.concatenate([one.recorded for one in single]),
            "modelled": np.concatenate([one.modelled for one in single]),
            "channels": channels,
            "nuisances": {},
            "collinear_sets": sets,
            "moves": any(one.moves for one in single),
            "recording_notes": tuple(
                f"{one.recording}: {note}" if count > 1 else note
                for one in single
                for note in one.recording_notes
            ),
        },
        recordings=tuple(parts),
        contradicted=tuple(
            NAMES[column] for i, column in enumerate(results[0].objective.space.columns) if contradicted[i]
        ),
    )


def _bias(joint: JointObjective, results: Sequence[SearchResult], point: Array, seed: int) -> Array:
    """Return how far the model's discrepancy, where it is known, leads a fit without correction, (d,)."""
    normals, gradients = list[Array](), list[Array]()
    for r, result in enumerate(results):
        rows = result.objective.channel_rows
        jacobians = jacobians_at(result.objective, result.point, stream(seed, "Jacobians of the bias", r))
        variance = max(float(np.mean(result.fitted_residual[:rows] ** 2)), np.finfo(float).tiny)
        normals.append(information(jacobians) / variance)
        gradients.append(jacobians.mean(axis=0) @ result.remaining_bias[:rows] / variance)
    prior = np.diag(CORRELATED_ROWS / joint.prior_deviations**2)
    step = np.linalg.solve(joint.summed_matrices(normals) + prior, joint.summed_vectors(gradients))
    return np.asarray(joint.box.project(point - step) - point)


def _recording(
    single: Diagnosis, alone: SearchResult, result: SearchResult, *, contradicts: bool
) -> JointRecording:
    own = float(np.sqrt(np.mean(alone.fitted_residual[: alone.objective.problem.samples] ** 2)))
    return JointRecording(
        single.recording,
        single.channels,
        single.explained,
        single.residual_rms_A,
        single.relative_residual,
        single.residual_rms_A / max(own, np.finfo(float).tiny),
        contradicts,
        tuple(result.objective.space.faults(alone.point).tolist()),
        single.nuisances,
    )


def _undecided(one: Estimate) -> Estimate:
    return replace(one, verdict="cannot tell", reason=one.reason or CONTRADICTED)


def _end_to_end(times: Sequence[Array]) -> Array:
    """Return the times [s] of recordings, each beginning an interval after the end of the one before."""
    placed, offset = list[Array](), float(times[0][0])
    for time_s in times:
        placed.append(time_s - time_s[0] + offset)
        offset = float(placed[-1][-1] + (time_s[-1] - time_s[0]) / (time_s.size - 1))
    return np.concatenate(placed)
