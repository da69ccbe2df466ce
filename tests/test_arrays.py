"""Array functions for all rooms."""

import numpy as np

from emaphm.arrays import runs


def test_runs_of_true_rows_are_found_including_both_ends() -> None:
    assert runs(np.array([True, True, False, True, False, True, True, True])) == [(0, 2), (3, 4), (5, 8)]
    assert runs(np.zeros(4, bool)) == []
