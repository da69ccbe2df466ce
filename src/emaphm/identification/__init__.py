"""Which faults explain a recording, and how sure that is."""

from emaphm.identification.calibration import Calibration, calibrate
from emaphm.identification.design import Design, design
from emaphm.identification.diagnose import diagnose
from emaphm.identification.diagnosis import Diagnosis, Estimate
from emaphm.identification.error import error_percent
from emaphm.identification.fitness import FITNESSES
from emaphm.identification.methods import METHODS
from emaphm.identification.replay import Replay, replay

__all__ = [
    "FITNESSES",
    "METHODS",
    "Calibration",
    "Design",
    "Diagnosis",
    "Estimate",
    "Replay",
    "calibrate",
    "design",
    "diagnose",
    "error_percent",
    "replay",
]
