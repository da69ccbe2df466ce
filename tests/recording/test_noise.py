"""Estimates of a channel's noise and rounding step, compared with known noise and steps."""

import numpy as np
import pytest

from emaphm.recording.noise import robust_noise_level, rounding_step


def test_the_noise_and_the_rounding_step_of_a_column_are_estimated() -> None:
    rng, smooth = np.random.default_rng(0), np.sin(np.arange(20_000) / 500)
    noisy = smooth + rng.normal(0, 0.01, smooth.size)
    # With 20,000 rows, the scale from a median is accurate to some percent.
    assert robust_noise_level(noisy, 2) == pytest.approx(0.01, rel=0.05)
    noisy[::100] = 5.0
    assert robust_noise_level(noisy, 2) == pytest.approx(0.01, rel=0.1)
    assert rounding_step(np.round(smooth / 0.01) * 0.01) == pytest.approx(0.01)
    assert rounding_step(np.zeros(5)) == 0.0
