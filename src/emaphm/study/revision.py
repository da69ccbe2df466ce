"""Fingerprint of the code that decides the results of a study's trials."""

from emaphm.diagnosis import deciding_code as diagnosis
from emaphm.execution.revision import revision_of

DECIDING = (
    *diagnosis.DECIDING,
    "amortized",
    "fleet/settings.py",
    "calibration",
    "simulated_recording.py",
    "study/task.py",
    "study/record.py",
    "study/contestant.py",
    "study/foreign_plant.py",
)
"""Folders and files of the package whose code decides the results of trials.

Cases, rigs and settings of methods are values of the plan, which are part of a result's key
(`emaphm.study.store.tasks`).
"""

NOT_DECIDING = (*diagnosis.NOT_DECIDING, "recording/io", "diagnosis/wording.py", "calibration/text.py")
"""Parts of these folders that read files or write text: a study does not use them."""


def revision() -> str:
    """Return a fingerprint of the code and libraries that decide results, and of Python's version.

    Docstrings, comments, layout, and code that draws or prints have no influence.
    """
    return revision_of(DECIDING, NOT_DECIDING)
