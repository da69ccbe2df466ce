"""Diagnosis: faults that explain a recording, their uncertainty, and what is not identifiable."""

from emaphm.diagnosis.diagnose import diagnose
from emaphm.diagnosis.error_metric import error_percent
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import Estimate

__all__ = ["Diagnosis", "Estimate", "diagnose", "error_percent"]
