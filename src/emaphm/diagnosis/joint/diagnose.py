"""Joint diagnosis of several recordings of one unit: common faults, and nuisances of each recording."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.argument import check_actuator
from emaphm.arrays import Array
from emaphm.blas_threads import one_blas_thread
from emaphm.diagnosis.conclusion import conclude
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
"""Number of starting points of the joint descent: the best of the separate estimates and their mean."""

ALONE_SHARE = 0.6
"""Share of the progress bar for the separate searches."""


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

    The sensors of each recording are checked as in a single diagnosis, and unusable rows are not compared.
    The faults and the deviations from the actuator's baseline are common; each recording has its own
    channels and its own nuisances, such as load and temperature. If the estimates scatter by more than their
    errors, the covariance includes this scatter; if recordings contradict each other, no component is called
    healthy or degraded, and the recordings that contradict the others are named.

    Parameters
    ----------
    nuisances, max_corrections, seed, workers, on_progress
        As for `emaphm.diagnose`. A nuisance that deviates significantly from the description in one
        recording is estimated in all, and so is a law that the description lacks, except a lag of the
        current sensors, which is not tested.

    Raises
    ------
    MethodError
        There is no recording, the recordings are of different units, a recording has no current, or a
        nuisance is unknown.
    RecordingError
        The values of a recording differ from this actuator's by orders of magnitude, too few rows of its
        current are usable, two recordings are the same, or one is no `Recording`.
    ActuatorError
        `actuator` is no `Actuator`.
    """
    began = time.perf_counter()
    for recording in recordings:
        check_recording(recording)
    check_actuator(actuator)
    _check(recordings, actuator)
    checked = [
        with_channels_exchanged(check_sensors(recording, actuator), actuator, AVERAGED)
        for recording in recordings
    ]
    searches = search_alone(
        checked,
        actuator,
        nuisances,
        SearchSettings(method_named(METHOD), max_corrections, seed),
        workers,
        subprogress(on_progress, 0.0, ALONE_SHARE),
    )
    separate_results = searches.results
    joint, point = _fitted(separate_results, workers)
    if max_corrections:
        joint = joint.corrected([np.zeros_like(term.correction) for term in joint.terms])
    correcting = subprogress(on_progress, ALONE_SHARE, 0.95)
    estimate = corrected_estimate(joint, point, max_corrections, seed, correcting)
    # Without correction, the separate searches end before their optimum: steps from the joint estimate then
    # give the separate estimates.
    separate_estimates = alone_estimates(separate_results, joint, seed) if estimate.corrected else None
    uncertainty = joint_uncertainty(estimate, seed, alone=separate_estimates, slow_terms=estimate.corrected)
    results = [with_discrepancy(result, seed) for result in _by_recording(estimate, uncertainty.point)]
    single = [
        replace(
            conclude(result, check.recording, METHOD, "least_squares", seed, tests=False),
            selected=searches.selected,
        ).with_sensor_faults(check.findings)
        for result, check in zip(results, checked, strict=True)
    ]
    diagnosis = conclusion(separate_results, results, single, estimate, uncertainty, seed)
    runs = [result.objective.problem.runs.of(AVERAGED) for result in results]
    return replace(
        diagnosis.with_laws(searches.laws),
        evaluations=sum(fitted for fitted, _ in runs),
        reference_runs=sum(reference for _, reference in runs),
        seconds=time.perf_counter() - began,
    )


def _check(recordings: Sequence[Recording], actuator: Actuator) -> None:
    """Refuse recordings that cannot be of one unit, before any search."""
    if not recordings:
        raise MethodError("no recording to diagnose; give those of one unit")
    serials = {
        str(serial): recording for recording in recordings if (serial := recording.labels.get("serial"))
    }
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
    """Return the joint objective with the corrections of the separate searches, and its fitted point (d,)."""
    space = alone[0].objective.space
    unit = space.nuisances.unit
    shared = len(space.columns) + unit.priors.size
    terms = tuple(
        RecordingTerm(separate.objective, shared, separate.outputs_correction) for separate in alone
    )
    joint = JointObjective(terms, unit, MULTISTART.fine.step, workers)
    point = np.zeros(joint.box.lower.size)
    for index, separate in zip(joint.indices, alone, strict=True):
        point[index] = separate.point
    starts = np.tile(point, (len(alone) + 1, 1))
    shared_values = np.array(
        [separate.point[term.shared_places] for separate, term in zip(alone, terms, strict=True)]
    )
    starts[:, : joint.shared] = [*shared_values, shared_values.mean(axis=0)]
    costs = np.array([separate.cost for separate in joint.evaluate(joint.box.project(starts))])
    best = np.argsort(costs, kind="stable")[:STARTS]
    return joint, descend(joint, starts[best], joint.box, MULTISTART.fine).best


def _by_recording(estimate: JointEstimate, point: Array) -> list[SearchResult]:
    """Return the joint estimate as a result of each recording, with its discrepancy."""
    joint, corrected = estimate.joint, estimate.corrected
    return [
        SearchResult.at(
            term.objective,
            joint.local(r, point),
            correction=discrepancy.mean if corrected else term.correction,
            discrepancy=discrepancy if corrected else None,
        )
        for r, (term, discrepancy) in enumerate(zip(joint.terms, estimate.discrepancies, strict=True))
    ]
