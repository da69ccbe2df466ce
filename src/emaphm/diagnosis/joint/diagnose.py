"""From several recordings of one unit to one diagnosis: common faults, and what is each recording's own."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.argument import check_actuator
from emaphm.arrays import Array
from emaphm.blas_threads import one_blas_thread
from emaphm.diagnosis.diagnose import conclude
from emaphm.diagnosis.joint.alone import METHOD, alone_estimates, search_alone
from emaphm.diagnosis.joint.conclusion import conclusion
from emaphm.diagnosis.joint.result import JointDiagnosis
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import MAX_CORRECTIONS, with_discrepancy
from emaphm.estimation.global_search.multistart import MULTISTART
from emaphm.estimation.joint.correction import JointEstimate, corrected_estimate
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.joint.uncertainty import joint_uncertainty
from emaphm.estimation.levenberg_marquardt import descend
from emaphm.estimation.methods import method_named
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.sensors.channel_swaps import with_channels_exchanged
from emaphm.progress import Progress, subprogress
from emaphm.recording import Recording, check_plausible
from emaphm.recording.argument import check_recording
from emaphm.recording.content import check_each_once
from emaphm.recording.sensor_checks import check_sensors
from emaphm.simulation import AVERAGED

STARTS = 3
"""Points that the joint descent begins at: the best of what the recordings alone ask for, and their mean."""

ALONE_SHARE = 0.6
"""Share of the time that the searches of single recordings take."""


@one_blas_thread()
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

    The sensors of each are checked as those of one alone are, and rows that they spoilt are not compared.
    The faults and the deviations from the actuator's baseline are common; nuisances, such as load and
    temperature, are each recording's own, as are the channels. Where recordings scatter by more than their
    errors, the covariance includes it; where they contradict each other, no component is called healthy or
    degraded, and those that contradict the others are named.

    Parameters
    ----------
    nuisances, max_corrections, seed, workers, on_progress
        As for `emaphm.diagnose`. What deviates significantly from the description in one recording is
        estimated of all; so is a law that the description lacks, but for a lag of the current sensors, which
        is not looked for.

    Raises
    ------
    MethodError
        There is no recording, they are of different units, one has no current, or a nuisance is unknown.
    RecordingError
        A recording cannot be of this actuator, by orders of magnitude, or too little of its current is left;
        or two are the same, or one is no `Recording`.
    ActuatorError
        `actuator` is no `Actuator`.
    """
    began = time.perf_counter()
    for one in recordings:
        check_recording(one)
    check_actuator(actuator)
    _check(recordings, actuator)
    checked = [
        with_channels_exchanged(check_sensors(one, actuator), actuator, AVERAGED) for one in recordings
    ]
    searches = search_alone(
        checked,
        actuator,
        nuisances,
        SearchSettings(method_named(METHOD), max_corrections, seed),
        workers,
        subprogress(on_progress, 0.0, ALONE_SHARE),
    )
    alone = searches.results
    joint, point = _fitted(alone, workers)
    if max_corrections:
        joint = joint.corrected([np.zeros_like(term.correction) for term in joint.terms])
    correcting = subprogress(on_progress, ALONE_SHARE, 0.95)
    estimate = corrected_estimate(joint, point, max_corrections, seed, correcting)
    # Without correction the searches stop short of what each recording asks for: steps from the joint
    # estimate show it.
    separate = alone_estimates(alone, joint, seed) if estimate.corrected else None
    known = joint_uncertainty(estimate, seed, alone=separate)
    results = [with_discrepancy(one, seed) for one in _by_recording(estimate, known.point)]
    single = [
        replace(
            conclude(result, one.recording, METHOD, "least_squares", seed, tests=False),
            selected=searches.selected,
        ).with_sensor_faults(one.findings)
        for result, one in zip(results, checked, strict=True)
    ]
    joint_diagnosis = conclusion(alone, results, single, estimate, known, seed)
    models = [one.objective.problem.runs.of(AVERAGED) for one in results]
    return replace(
        joint_diagnosis.with_laws(searches.laws),
        evaluations=sum(run for run, _ in models),
        reference_runs=sum(run for _, run in models),
        seconds=time.perf_counter() - began,
    )


def _check(recordings: Sequence[Recording], actuator: Actuator) -> None:
    """Refuse recordings that cannot be of one unit, before the work."""
    if not recordings:
        raise MethodError("no recording to diagnose; give those of one unit")
    serials = {str(one): recording for recording in recordings if (one := recording.labels.get("serial"))}
    if len(serials) > 1:
        (first, recording), (second, other) = list(serials.items())[:2]
        raise MethodError(
            f"{other.source} is of unit '{second}', {recording.source} of unit '{first}'; a joint estimate "
            "is of one unit: leave the others out, or diagnose without --joint"
        )
    check_each_once(recordings)
    for recording in recordings:
        check_plausible(recording, actuator)


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
