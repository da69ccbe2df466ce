"""What every room takes for arrays."""

import numpy as np

from emaphm.arrays import runs


def test_runs_are_found_from_end_to_end() -> None:
    assert runs(np.array([True, True, False, True, False, True, True, True])) == [(0, 2), (3, 4), (5, 8)]
    assert runs(np.zeros(4, bool)) == []
