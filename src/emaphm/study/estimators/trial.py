"""One trial of the study of an estimator: outcome, errors and computing time of a method for a recording."""

import time
from typing import Any

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.amortized import Estimator, answer_alone
from emaphm.diagnosis import Diagnosis
from emaphm.diagnosis.error_metric import error_percent
from emaphm.errors import EmaphmError
from emaphm.fleet import DiagnosisSettings
from emaphm.recording import Recording
from emaphm.study.analysis.rates import holds
from emaphm.study.estimators.cases import RecordingCase
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre
from emaphm.study.spoilt.judging import judged, refused
from emaphm.study.spoilt.run import cases as spoilt_cases
from emaphm.study.spoilt.run import spoilt

METHODS = ("estimator alone", "estimator, corrected", "full search")
WITHOUT_SEARCH = "estimator without search"
"""The first method without its search: if it would search, the outcome is `NOT_TAKEN`."""

NOT_TAKEN = "not taken"


def perform(case: RecordingCase, method: str, path: str) -> dict[str, Any]:
    """Return the result of a method for a case; an `EmaphmError` also counts as an outcome."""
    actuator = Actuator.thesis()
    if case.rig is None:
        try:
            recording, actuator, truth = spoilt(spoilt_cases()[case.number])
        except EmaphmError as error:
            return refused(str(error))
    else:
        truth = Faults(*case.truth)
        recording = recorded(case.rig, actuator, Manoeuvre(), truth, case.number)
    try:
        return _diagnosed(recording, actuator, truth, method, path, case.number)
    except EmaphmError as error:
        return refused(str(error))


def _diagnosed(
    recording: Recording, actuator: Actuator, truth: Faults, method: str, path: str, seed: int
) -> dict[str, Any]:
    if method == WITHOUT_SEARCH:
        answer = answer_alone(Estimator.load(path), recording, actuator, seed=seed)
        if isinstance(answer, Diagnosis):
            return judged(answer, truth) | {"method": answer.method, "error": _error(answer, truth)}
        return {"outcome": NOT_TAKEN, "reasons": list(answer)}
    settings = DiagnosisSettings(
        estimator=None if method == METHODS[2] else path,
        fast=method == METHODS[0],
        nuisances=None if method == METHODS[0] else Estimator.load(path).setup.nuisances,
        seed=seed,
    )
    began = time.process_time()
    diagnosis = settings.diagnosed(recording, actuator)
    return judged(diagnosis, truth) | {
        "method": diagnosis.method,
        "error": _error(diagnosis, truth),
        "covered": [
            bool(holds(name, diagnosis.interval[name], true))
            for name, true in zip(NAMES, truth.vector, strict=True)
        ],
        "degraded": [diagnosis.components[name].verdict == "degraded" for name in NAMES],
        "moves": diagnosis.moves,
        "wall_s": diagnosis.seconds,
        "processor_s": time.process_time() - began,
    }


def _error(diagnosis: Diagnosis, truth: Faults) -> float:
    return float(error_percent(truth.vector, diagnosis.faults.vector))
