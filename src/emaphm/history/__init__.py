"""History of units: flights, recordings, diagnoses, removals and shop findings in one database."""

from importlib.util import find_spec

from emaphm.errors import HistoryError

if find_spec("sqlalchemy") is None or find_spec("alembic") is None:
    raise HistoryError("a history needs further libraries; install them with: pip install 'emaphm[history]'")

from emaphm.history.events import Event
from emaphm.history.history import Added, History
from emaphm.history.kept_diagnosis import KeptDiagnosis, KeptSettings
from emaphm.history.kept_prognosis import KeptPrognosis
from emaphm.history.lives import Failure, Life
from emaphm.history.records import (
    CONDITIONS,
    FINDABLE,
    REASONS,
    Entry,
    Finding,
    Flight,
    Mistake,
    Removal,
    Replacement,
    Withdrawal,
)
from emaphm.history.unit import Unit

__all__ = [
    "CONDITIONS",
    "FINDABLE",
    "REASONS",
    "Added",
    "Entry",
    "Event",
    "Failure",
    "Finding",
    "Flight",
    "History",
    "KeptDiagnosis",
    "KeptPrognosis",
    "KeptSettings",
    "Life",
    "Mistake",
    "Removal",
    "Replacement",
    "Unit",
    "Withdrawal",
]
