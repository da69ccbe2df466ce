"""The conclusion of a joint diagnosis: verdicts, intervals, and contradictions between recordings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import NAMES
from emaphm.arrays import Array, rms
from emaphm.diagnosis.conclusion import nuisance_estimates, tested
from emaphm.diagnosis.identifiability import collinear_sets
from emaphm.diagnosis.joint.alone import with_better_fits
from emaphm.diagnosis.joint.result import JointDiagnosis, JointRecording, on_contradictions
from emaphm.diagnosis.nuisance_estimate import of_unit
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import Estimate, estimates, unexplained
from emaphm.estimation.joint.contradictions import contradictions, dissenting
from emaphm.estimation.joint.correction import JointEstimate
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.joint.uncertainty import AloneEstimates, JointUncertainty
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
    uncertainty: JointUncertainty,
    seed: int,
) -> JointDiagnosis:
    """Return the diagnosis of the unit, with its numbers of simulations and its time still those of one part.

    Parameters
    ----------
    alone
        Results of the separate searches.
    results, single
        The joint estimate as a result of each recording, and the diagnoses from these results.
    estimate, uncertainty
        The joint fit, and its uncertainty.
    """
    joint, space = estimate.joint, results[0].objective.space
    between = _between_recordings(alone, results, estimate, uncertainty)
    explained = all(diagnosis.explained for diagnosis in single)
    covariance = _covariance(estimate, uncertainty, between, results, seed)
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
    recordings = tuple(
        _recording_entry(diagnosis, searched, result, contradicts=bool(named))
        for diagnosis, searched, result, named in zip(single, alone, results, between.named, strict=True)
    )
    contradicted = tuple(
        dict.fromkeys(NAMES[column] for i, column in enumerate(space.columns) if between.contradicted[i])
    )
    common = _common_fields(single)
    return JointDiagnosis(
        **common
        | {
            "reasons": (*on_contradictions(recordings, contradicted), *common["reasons"]),
            "components": components,
            "coordinates": tuple(space.coordinates[i] for i in joint.terms[0].shared_places),
            "covariance": covariance[: joint.shared, : joint.shared],
            "fitness": float(np.mean(residual**2)),
            "residual_rms_A": rms(residual),
            "explained": between.agree and explained,
            "nuisances": of_unit(nuisance_estimates(results[0].objective, results[0].point, local)),
            "collinear_sets": sets,
        },
        recordings=recordings,
        contradicted=contradicted,
    )


def _covariance(
    estimate: JointEstimate,
    uncertainty: JointUncertainty,
    between: "_Between",
    results: Sequence[SearchResult],
    seed: int,
) -> Array:
    """Return the covariance (d, d) of the joint estimate: of its fit, its scatter and between recordings."""
    joint = estimate.joint
    covariance = uncertainty.covariance + estimate.scatter
    covariance[: joint.shared, : joint.shared] += between.covariance
    if estimate.corrected:
        return covariance
    bias = _bias_of_estimate(joint, results, uncertainty.point, seed)
    return np.asarray(covariance + np.outer(bias, bias))


def _common_fields(single: Sequence[Diagnosis]) -> dict[str, Any]:
    """Return the fields of the joint diagnosis that follow from those of the recordings, end to end."""
    first, count = single[0], len(single)
    return {field.name: getattr(first, field.name) for field in fields(first)} | {
        "recording": first.recording if count == 1 else f"{count} recordings",
        "time_s": _times_end_to_end([diagnosis.time_s for diagnosis in single]),
        "recorded": np.concatenate([diagnosis.recorded for diagnosis in single]),
        "modelled": np.concatenate([diagnosis.modelled for diagnosis in single]),
        "channels": tuple(dict.fromkeys(name for diagnosis in single for name in diagnosis.channels)),
        "moves": any(diagnosis.moves for diagnosis in single),
        "recording_notes": _sentences_of_all(single, lambda diagnosis: diagnosis.recording_notes),
        "reasons": _sentences_of_all(single, lambda diagnosis: diagnosis.reasons),
        "sensor_faults": tuple(
            replace(fault, sentence=_with_recording_name(diagnosis, fault.sentence, count))
            for diagnosis in single
            for fault in diagnosis.sensor_faults
        ),
    }


def _tested_by_each(
    components: Mapping[str, Estimate], results: Sequence[SearchResult], seed: int
) -> dict[str, Estimate]:
    """Return the components of the unit, undecided if another explanation is as good for each recording.

    One recording that excludes the other explanations is enough: its verdict and interval are taken, the
    shortest interval of several.
    """
    shortest = dict[str, Estimate]()
    for result in results:
        jacobians = jacobians_of(result, stream(seed, "Jacobians of the covariance"))
        components_there = tested(components, result, jacobians, seed)
        shortest = {
            name: min(shortest.get(name, estimate), estimate, key=_doubt_key(components[name]))
            for name, estimate in components_there.items()
        }
        if shortest == components:
            break
    return shortest


def _doubt_key(first: Estimate) -> Callable[[Estimate], tuple[bool, float]]:
    """Return the sort key of an estimate: whether its verdict differs from `first`, then its length."""
    return lambda estimate: (
        estimate.verdict != first.verdict,
        estimate.interval95[1] - estimate.interval95[0],
    )


@dataclass(frozen=True, eq=False)
class _Between:
    """Contradictions between the recordings.

    `contradicted` (p,) marks shared coordinates, `named` (n,) marks recordings that contradict the others;
    `covariance` (p, p) is the covariance due to the scatter between recordings.
    """

    contradicted: NDArray[np.bool_]
    named: NDArray[np.bool_]
    covariance: Array

    @property
    def agree(self) -> bool:
        """Whether the recordings do not contradict each other."""
        return not (self.contradicted.any() or self.named.any())


def _between_recordings(
    alone: Sequence[SearchResult],
    results: Sequence[SearchResult],
    estimate: JointEstimate,
    uncertainty: JointUncertainty,
) -> _Between:
    """Return the contradictions; a separate search that ended away from its optimum is no evidence for one.

    Arguments as for `conclusion`.
    """
    separate, joint = uncertainty.alone, estimate.joint
    if separate is None or not estimate.corrected:
        return _contradictions_between(separate, joint)
    separate = with_better_fits(separate, alone, results, joint, slow_only=True)
    between = _contradictions_between(separate, joint)
    if between.agree:
        return between
    return _contradictions_between(with_better_fits(separate, alone, results, joint), joint)


def _contradictions_between(alone: AloneEstimates | None, joint: JointObjective) -> _Between:
    """Return the contradictions between the recordings; none without separate estimates."""
    shared, count = joint.shared, len(joint.terms)
    if alone is None:
        return _Between(np.zeros(shared, bool), np.zeros(count, bool), np.zeros((shared, shared)))
    priors = joint.prior_deviations[:shared]
    heterogeneity = contradictions(alone, priors)
    dissenters = dissenting(alone, priors)
    between = _Between(heterogeneity.contradicted, dissenters, heterogeneity.covariance)
    # The mean of n consistent recordings has 1/n of their scatter. Where they contradict each other, the
    # value of any recording may be the true one.
    return replace(between, covariance=heterogeneity.covariance / count) if between.agree else between


def _bias_of_estimate(
    joint: JointObjective, results: Sequence[SearchResult], point: Array, seed: int
) -> Array:
    """Return the error (d,) of an uncorrected fit due to the known discrepancy of the model."""
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


def _recording_entry(
    single: Diagnosis, alone: SearchResult, result: SearchResult, *, contradicts: bool
) -> JointRecording:
    """Return the entry of one recording."""
    common = of_unit(single.nuisances)
    separate_rms = rms(alone.compared_residual)
    return JointRecording(
        name=single.recording,
        channels=single.channels,
        explained=single.explained,
        residual_rms_A=single.residual_rms_A,
        relative_residual=single.relative_residual,
        misfit_ratio=single.residual_rms_A / max(separate_rms, np.finfo(float).tiny),
        contradicts=contradicts,
        alone=tuple(result.objective.space.faults(alone.point).tolist()),
        nuisances={name: estimate for name, estimate in single.nuisances.items() if name not in common},
        load=single.load,
    )


def _sentences_of_all(
    single: Sequence[Diagnosis], of: Callable[[Diagnosis], Sequence[str]]
) -> tuple[str, ...]:
    """Return the sentences that all recordings share, then the others with the names of their recordings."""
    shared = [
        sentence for sentence in of(single[0]) if all(sentence in of(diagnosis) for diagnosis in single)
    ]
    others = [
        _with_recording_name(diagnosis, sentence, len(single))
        for diagnosis in single
        for sentence in of(diagnosis)
        if sentence not in shared
    ]
    return (*shared, *others)


def _with_recording_name(diagnosis: Diagnosis, sentence: str, count: int) -> str:
    """Return a sentence, preceded by the name of its recording if there are several."""
    return f"{diagnosis.recording}: {sentence}" if count > 1 else sentence


def _undecided(estimate: Estimate) -> Estimate:
    """Return an estimate as undecided because the recordings contradict each other."""
    return replace(estimate, verdict="cannot tell", reason=estimate.reason or CONTRADICTED)


def _times_end_to_end(times: Sequence[Array]) -> Array:
    """Return the times [s] of all recordings in sequence, one interval apart."""
    placed, offset = list[Array](), float(times[0][0])
    for time_s in times:
        placed.append(time_s - time_s[0] + offset)
        offset = float(placed[-1][-1] + (time_s[-1] - time_s[0]) / (time_s.size - 1))
    return np.concatenate(placed)
