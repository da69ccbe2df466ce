"""Queries of a history for pages and the HTTP API: states of many units, pages of diagnoses, curves."""

from emaphm.history.views.curves import read_curves
from emaphm.history.views.diagnoses import DiagnosisLine, diagnosis, diagnosis_lines, last_diagnosis
from emaphm.history.views.states import NO_PROGNOSES, Marks, UnitState, changed_units, marks, states

__all__ = [
    "NO_PROGNOSES",
    "DiagnosisLine",
    "Marks",
    "UnitState",
    "changed_units",
    "diagnosis",
    "diagnosis_lines",
    "last_diagnosis",
    "marks",
    "read_curves",
    "states",
]
