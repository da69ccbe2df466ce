"""What a method makes of a recording: its outcome, its errors and its time."""

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
"""Of the first method what its answer alone is: where it would search, the outcome is `NOT_TAKEN`."""

NOT_TAKEN = "not taken"


def perform(case: RecordingCase, method: str, path: str) -> dict[str, Any]:
    """Return what a method makes of a case; an error of the user's is an outcome too."""
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
        found = answer_alone(Estimator.load(path), recording, actuator, seed=seed)
        if isinstance(found, Diagnosis):
            return judged(found, truth) | {"method": found.method, "error": _error(found, truth)}
        return {"outcome": NOT_TAKEN, "reasons": list(found)}
    settings = DiagnosisSettings(
        estimator=None if method == METHODS[2] else path,
        fast=method == METHODS[0],
        nuisances=None if method == METHODS[0] else Estimator.load(path).setup.nuisances,
        seed=seed,
    )
    processor = time.process_time()
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
        "processor_s": time.process_time() - processor,
    }


def _error(diagnosis: Diagnosis, truth: Faults) -> float:
    return float(error_percent(truth.vector, diagnosis.faults.vector))
