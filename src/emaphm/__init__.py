"""Diagnosis and prognosis of electromechanical actuators from their recordings.

>>> import emaphm as ema
>>> actuator = ema.Actuator.thesis()
>>> recording = ema.simulate(actuator, ema.Chirp(), faults=ema.Faults(friction=0.25))
>>> diagnosis = ema.diagnose(recording, actuator, seed=0)
>>> bool(abs(diagnosis.faults.friction - 0.25) < 0.02)
True
"""

from importlib import import_module

TYPE_CHECKING = False  # importing `typing` would dominate the first milliseconds of the command
if TYPE_CHECKING:
    from typing import Any

    from emaphm.actuator import (
        Actuator,
        Chirp,
        DecayingChirp,
        Faults,
        Ramp,
        Sampled,
        Sine,
        Step,
    )
    from emaphm.amortized import Estimator, RecordingSetup, answer_alone, diagnose_by, train_estimator
    from emaphm.calibration import Calibration, CampaignRow, calibrate, read_campaign
    from emaphm.detection import Detector, DetectorResult
    from emaphm.diagnosis import Diagnosis, diagnose, error_percent
    from emaphm.diagnosis.joint import JointDiagnosis, diagnose_joint
    from emaphm.errors import EmaphmError
    from emaphm.estimation import replay
    from emaphm.experiment import Design, Segments, design, segments
    from emaphm.fleet import DiagnosisSettings, diagnose_all
    from emaphm.history import History
    from emaphm.recording import Recording, acquire, read_recording, read_recordings, write_recording
    from emaphm.report import write_report
    from emaphm.simulated_recording import simulate
    from emaphm.simulation import simulate_batch

    __version__: str

_HOMES = {
    "emaphm.actuator": "Actuator Chirp DecayingChirp Faults Ramp Sampled Sine Step",
    "emaphm.errors": "EmaphmError",
    "emaphm.amortized": "Estimator RecordingSetup answer_alone diagnose_by train_estimator",
    "emaphm.calibration": "Calibration CampaignRow calibrate read_campaign",
    "emaphm.detection": "Detector DetectorResult",
    "emaphm.diagnosis": "Diagnosis diagnose error_percent",
    "emaphm.diagnosis.joint": "JointDiagnosis diagnose_joint",
    "emaphm.estimation": "replay",
    "emaphm.experiment": "Design Segments design segments",
    "emaphm.fleet": "DiagnosisSettings diagnose_all",
    "emaphm.history": "History",
    "emaphm.recording": "Recording acquire read_recording read_recordings write_recording",
    "emaphm.report": "write_report",
    "emaphm.simulated_recording": "simulate",
    "emaphm.simulation": "simulate_batch",
}
_HOME = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = [
    "Actuator",
    "Calibration",
    "CampaignRow",
    "Chirp",
    "DecayingChirp",
    "Design",
    "Detector",
    "DetectorResult",
    "Diagnosis",
    "DiagnosisSettings",
    "EmaphmError",
    "Estimator",
    "Faults",
    "History",
    "JointDiagnosis",
    "Ramp",
    "Recording",
    "RecordingSetup",
    "Sampled",
    "Segments",
    "Sine",
    "Step",
    "__version__",
    "acquire",
    "answer_alone",
    "calibrate",
    "design",
    "diagnose",
    "diagnose_all",
    "diagnose_by",
    "diagnose_joint",
    "error_percent",
    "read_campaign",
    "read_recording",
    "read_recordings",
    "replay",
    "segments",
    "simulate",
    "simulate_batch",
    "train_estimator",
    "write_recording",
    "write_report",
]


def __getattr__(name: str) -> "Any":
    """Import a public name on first use: the command line prints --help without loading a compiler."""
    if name == "__version__":
        return import_module("emaphm.version").VERSION
    if name not in _HOME:
        raise AttributeError(f"module 'emaphm' has no attribute '{name}'")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    """List all names of the module, including public names that are not imported yet."""
    return sorted({*globals(), *__all__})
