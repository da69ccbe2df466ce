"""Which faults explain a recording, and how sure that is."""

from emaphm.identification.diagnose import METHODS, diagnose
from emaphm.identification.diagnosis import Diagnosis, Estimate
from emaphm.identification.error import error_percent
from emaphm.identification.fitness import FITNESSES

__all__ = ["FITNESSES", "METHODS", "Diagnosis", "Estimate", "diagnose", "error_percent"]
