"""Which code decides what a trial finds."""

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
"""The rooms and files whose code decides what a trial finds.

Cases, rigs and settings of methods are values of the plan, which identify a result by themselves
(`emaphm.study.store.tasks`).
"""

NOT_DECIDING = (*diagnosis.NOT_DECIDING, "recording/io", "diagnosis/wording.py", "calibration/text.py")
"""Parts of these rooms that read files or put words: a study does not pass through them."""


def revision() -> str:
    """Return a fingerprint of the code and libraries that decide results, and of Python's version.

    Docstrings, comments and layout do not count, nor what draws or prints.
    """
    return revision_of(DECIDING, NOT_DECIDING)
