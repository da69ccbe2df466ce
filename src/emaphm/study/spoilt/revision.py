"""Which code decides what becomes of a spoilt recording."""

from emaphm.diagnosis import deciding_code as diagnosis
from emaphm.execution.revision import revision_of

DECIDING = (
    *diagnosis.DECIDING,
    "simulated_recording.py",
    "experiment/test_setup.py",
    "study/cases.py",
    "study/spoilt",
)
"""The rooms and files whose code decides it. A case names its faults and class, whose values are in these."""

NOT_DECIDING = (
    *diagnosis.NOT_DECIDING,
    "recording/io",
    "diagnosis/wording.py",
    "study/spoilt/__main__.py",
    "study/spoilt/rates.py",
    "study/spoilt/revision.py",
)
"""Parts of these rooms that read files, put results in words, or count and print them."""


def revision() -> str:
    """Return a fingerprint of the code and libraries that decide results, and of Python's version."""
    return revision_of(DECIDING, NOT_DECIDING)
