"""Fingerprint of the code that decides the outcome of a spoilt recording."""

from emaphm.diagnosis import deciding_code as diagnosis
from emaphm.execution.revision import revision_of

DECIDING = (
    *diagnosis.DECIDING,
    "simulated_recording.py",
    "experiment/test_setup.py",
    "study/cases.py",
    "study/spoilt",
)
"""Folders and files whose code decides the outcome; they contain the faults and classes that a case names."""

NOT_DECIDING = (
    *diagnosis.NOT_DECIDING,
    "recording/io",
    "diagnosis/wording.py",
    "study/spoilt/__main__.py",
    "study/spoilt/rates.py",
    "study/spoilt/revision.py",
)
"""Parts of these folders that read files, write results as text, or count and print them."""


def revision() -> str:
    """Return a fingerprint of the code and libraries that decide results, and of Python's version."""
    return revision_of(DECIDING, NOT_DECIDING)
