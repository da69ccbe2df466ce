"""A short run of the fuzzer with each test run; ``make fuzz`` is the long run."""

import pytest

from .classes import CLASSES
from .run import fuzz

PROCESS = [name for name, (_, weight) in CLASSES.items() if weight == 1]
"""Classes that start a process for each case."""


SLOW = ["mdf: bytes"]
"""Loading its library takes seconds; `tests/recording/test_logger_files.py` also damages such a file."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.evidence) if name in SLOW else name for name in CLASSES]
)
def test_spoilt_inputs_are_refused_in_one_line_or_read(name: str) -> None:
    report = fuzz(0, cases=1 if name in PROCESS else 8, names=[name])
    assert not report.complaints, report.complaints[0][2]
