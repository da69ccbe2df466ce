"""The conclusion of a joint diagnosis: verdicts, intervals, and contradictions between recordings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import NAMES
from emaphm.arrays import Array, rms
from emaphm.diagnosis.diagnose import nuisance_estimates, tested
from emaphm.diagnosis.identifiability import collinear_sets
from emaphm.diagnosis.joint.result import JointDiagnosis, JointRecording
from emaphm.diagnosis.nuisance_estimate import of_unit
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import Estimate, estimates, unexplained
from emaphm.estimation.joint.contradictions import contradictions, dissenting
from emaphm.estimation.joint.correction import JointEstimate
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.joint.uncertainty import JointUncertainty
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.fisher_information import information
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, jacobians_of
from emaphm.random_streams import stream

CONTRADICTED = "the recordings contradict each other"


def conclusion(
    alone: Sequence[SearchResult],
    results: Sequence[SearchResult],
    single: Sequence[Diagnosis],
    estimate: JointEstimate,
    known: JointUncertainty,
    seed: int,
) -> JointDiagnosis:
    """Return the diagnosis of the unit; its counts and time are still to be filled in.

    Parameters
    ----------
    alone
        Where the search of each recording alone ended.
    results, single
        The joint estimate as each recording's own result, and what is concluded from that.
    estimate, known
        The joint fit, and how well it is known.
    """
    joint, space = estimate.joint, results[0].objective.space
    between = _between(known, joint)
    explained = all(diagnosis.explained for diagnosis in single)
    covariance = _covariance(estimate, known, between, results, seed)
    local = covariance[np.ix_(joint.indices[0], joint.indices[0])]
    sets = collinear_sets(results[0], local, seed)
    components = estimates(space, results[0].point, local, sets)
    if not explained:
        components = unexplained(components, space.fixed)
    elif not between.agree:
        components = {name: _undecided(component) for name, component in components.items()}
    else:
        components = _tested_by_each(components, results, seed)
    residual = np.concatenate([result.compared_residual for result in results])
    return JointDiagnosis(
        **_end_to_end(single)
        | {
            "components": components,
            "coordinates": tuple(space.coordinates[i] for i in joint.terms[0].shared_places),
            "covariance": covariance[: joint.shared, : joint.shared],
            "fitness": float(np.mean(residual**2)),
            "residual_rms_A": rms(residual),
            "explained": between.agree and explained,
            "nuisances": of_unit(nuisance_estimates(results[0].objective, results[0].point, local)),
            "collinear_sets": sets,
        },
        recordings=tuple(
            _recording(diagnosis, searched, result, contradicts=bool(named))
            for diagnosis, searched, result, named in zip(single, alone, results, between.named, strict=True)
        ),
        contradicted=tuple(
            dict.fromkeys(NAMES[column] for i, column in enumerate(space.columns) if between.contradicted[i])
        ),
    )


def _covariance(
    estimate: JointEstimate,
    known: JointUncertainty,
    between: "_Between",
    results: Sequence[SearchResult],
    seed: int,
) -> Array:
    """Return the covariance (d, d) of the joint estimate: of its fit, its scatter and between recordings."""
    joint = estimate.joint
    covariance = known.covariance + estimate.scatter
    covariance[: joint.shared, : joint.shared] += between.covariance
    if estimate.corrected:
        return covariance
    bias = _bias(joint, results, known.point, seed)
    return np.asarray(covariance + np.outer(bias, bias))


def _end_to_end(single: Sequence[Diagnosis]) -> dict[str, Any]:
    """Return fields of the diagnosis of all recordings: those of the first, and of all where they differ."""
    first, count = single[0], len(single)
    return {field.name: getattr(first, field.name) for field in fields(first)} | {
        "recording": first.recording if count == 1 else f"{count} recordings",
        "time_s": _times_end_to_end([diagnosis.time_s for diagnosis in single]),
        "recorded": np.concatenate([diagnosis.recorded for diagnosis in single]),
        "modelled": np.concatenate([diagnosis.modelled for diagnosis in single]),
        "channels": tuple(dict.fromkeys(name for diagnosis in single for name in diagnosis.channels)),
        "moves": any(diagnosis.moves for diagnosis in single),
        "recording_notes": _of_all(single, lambda diagnosis: diagnosis.recording_notes),
        "reasons": _of_all(single, lambda diagnosis: diagnosis.reasons),
        "sensor_faults": tuple(
            replace(fault, sentence=_named(diagnosis, fault.sentence, count))
            for diagnosis in single
            for fault in diagnosis.sensor_faults
        ),
    }


def _tested_by_each(
    components: Mapping[str, Estimate], results: Sequence[SearchResult], seed: int
) -> dict[str, Estimate]:
    """Return the components of the unit, undecided where something else explains each recording as well.

    What one of them excludes is excluded: where it keeps the verdict, its interval counts, of several the
    shortest.
    """
    judged = dict[str, Estimate]()
    for result in results:
        jacobians = jacobians_of(result, stream(seed, "Jacobians of the covariance"))
        by_recording = tested(components, result, jacobians, seed)
        judged = {
            name: min(judged.get(name, estimate), estimate, key=_by_verdict_and_length(components[name]))
            for name, estimate in by_recording.items()
        }
        if judged == components:
            break
    return judged


def _by_verdict_and_length(first: Estimate) -> Callable[[Estimate], tuple[bool, float]]:
    """Return what an estimate is ordered by: whether it has another verdict than `first`, then its length."""
    return lambda one: (one.verdict != first.verdict, one.interval95[1] - one.interval95[0])


@dataclass(frozen=True, eq=False)
class _Between:
    """What the recordings contradict each other in.

    `contradicted`, (p,), are the shared coordinates, `named`, (n,), the recordings that contradict the
    others; `covariance`, (p, p), is what their scatter adds to that of the joint estimate.
    """

    contradicted: NDArray[np.bool_]
    named: NDArray[np.bool_]
    covariance: Array

    @property
    def agree(self) -> bool:
        """Whether the recordings do not contradict each other."""
        return not (self.contradicted.any() or self.named.any())


def _between(known: JointUncertainty, joint: JointObjective) -> _Between:
    shared, count = joint.shared, len(joint.terms)
    if known.alone is None:
        return _Between(np.zeros(shared, bool), np.zeros(count, bool), np.zeros((shared, shared)))
    priors = joint.prior_deviations[:shared]
    found, named = contradictions(known.alone, priors), dissenting(known.alone, priors)
    between = _Between(found.contradicted, named, found.covariance)
    # The mean of recordings that scatter is known the better the more they are; what they contradict each
    # other in may be any of theirs.
    return replace(between, covariance=found.covariance / count) if between.agree else between


def _bias(joint: JointObjective, results: Sequence[SearchResult], point: Array, seed: int) -> Array:
    """Return how far the model's discrepancy, where it is known, leads a fit without correction, (d,)."""
    normals, gradients = list[Array](), list[Array]()
    for r, result in enumerate(results):
        rows = result.objective.channel_rows
        jacobians = jacobians_at(result.objective, result.point, stream(seed, "Jacobians of the bias", r))
        variance = max(float(np.mean(result.fitted_residual[:rows] ** 2)), np.finfo(float).tiny)
        normals.append(information(jacobians) / variance)
        gradients.append(jacobians.mean(axis=0) @ result.remaining_bias[:rows] / variance)
    prior = np.diag(joint.prior_precisions)
    step = np.linalg.solve(joint.summed_matrices(normals) + prior, joint.summed_vectors(gradients))
    return np.asarray(joint.box.project(point - step) - point)


def _recording(
    single: Diagnosis, alone: SearchResult, result: SearchResult, *, contradicts: bool
) -> JointRecording:
    common = of_unit(single.nuisances)
    own = rms(alone.compared_residual)
    return JointRecording(
        name=single.recording,
        channels=single.channels,
        explained=single.explained,
        residual_rms_A=single.residual_rms_A,
        relative_residual=single.relative_residual,
        misfit_ratio=single.residual_rms_A / max(own, np.finfo(float).tiny),
        contradicts=contradicts,
        alone=tuple(result.objective.space.faults(alone.point).tolist()),
        nuisances={name: one for name, one in single.nuisances.items() if name not in common},
        load=single.load,
    )


def _of_all(single: Sequence[Diagnosis], sentences: Callable[[Diagnosis], Sequence[str]]) -> tuple[str, ...]:
    """Return sentences on all recordings once, then those on some, each with the name of its recording."""
    shared = [
        sentence for sentence in sentences(single[0]) if all(sentence in sentences(one) for one in single)
    ]
    some = [
        _named(one, sentence, len(single))
        for one in single
        for sentence in sentences(one)
        if sentence not in shared
    ]
    return (*shared, *some)


def _named(diagnosis: Diagnosis, sentence: str, count: int) -> str:
    """Return a sentence of one recording of `count`."""
    return f"{diagnosis.recording}: {sentence}" if count > 1 else sentence


def _undecided(estimate: Estimate) -> Estimate:
    return replace(estimate, verdict="cannot tell", reason=estimate.reason or CONTRADICTED)


def _times_end_to_end(times: Sequence[Array]) -> Array:
    """Return the times [s] of recordings, each beginning an interval after the end of the one before."""
    placed, offset = list[Array](), float(times[0][0])
    for time_s in times:
        placed.append(time_s - time_s[0] + offset)
        offset = float(placed[-1][-1] + (time_s[-1] - time_s[0]) / (time_s.size - 1))
    return np.concatenate(placed)
