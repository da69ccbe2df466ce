"""Rows of a given signal, compared with its integral over the intervals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from emaphm.recording.signal_rows import signal_rows

INTERVAL = 2e-4
STARTS = np.asarray(np.arange(50) * INTERVAL, float)


@given(moment=st.floats(0.0, 50 * INTERVAL), size=st.floats(-5.0, 5.0))
def test_a_jump_is_located_to_a_thousandth_of_the_interval(moment: float, size: float) -> None:
    share_after = np.clip((STARTS + INTERVAL - moment) / INTERVAL, 0.0, 1.0)
    rows = signal_rows(lambda t: np.where(t >= moment, size, 0.0), STARTS, INTERVAL)
    np.testing.assert_allclose(rows, size * share_after, atol=abs(size) / 1000 + 1e-12)


@pytest.mark.parametrize("frequency", [0.0, 15.0, 1000.0])
def test_rows_of_a_smooth_signal_equal_its_integral(frequency: float) -> None:
    w = 2 * np.pi * frequency
    rows = signal_rows(lambda t: np.cos(w * t), STARTS, INTERVAL)
    exact = (np.sin(w * (STARTS + INTERVAL)) - np.sin(w * STARTS)) / (w * INTERVAL) if w else np.ones(50)
    # The midpoint rule of 16 points: (w h / 16)² / 24.
    np.testing.assert_allclose(rows, exact, atol=(w * INTERVAL / 16) ** 2 / 24 + 1e-14)
