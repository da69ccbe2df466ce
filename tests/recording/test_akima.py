"""The Akima interpolation of a channel's rows, compared with SciPy's."""

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator

from emaphm.arrays import Array
from emaphm.recording.akima import CHUNK, AkimaCurve

START, INTERVAL = 0.1, 2e-4
CURVES = {
    "noise": np.random.default_rng(4).random(400),
    "jump": np.repeat([0.0, 1.0], 50),
    "still": np.zeros(10),
    "sine": np.sin(0.1 * np.arange(300)),
    "three points": np.array([1.0, 3.0, -2.0]),
}


@pytest.mark.parametrize("values", CURVES.values(), ids=list(CURVES))
def test_the_curve_equals_scipys_akima_interpolation(values: Array) -> None:
    knots: Array = START + INTERVAL * np.arange(values.size, dtype=float)
    times: Array = np.linspace(knots[0] - INTERVAL / 2, knots[-1] + INTERVAL / 2, CHUNK + 1000)
    expected = Akima1DInterpolator(knots, values, extrapolate=True)(times)
    curve = AkimaCurve.through(values, START, INTERVAL)
    # Times of 0.1 s are exact to 1e-17 s, 1e-13 of an interval; a curve rises by a few units in one.
    assert np.abs(curve(times) - expected).max() < 1e-11
    assert np.abs(curve(knots) - values).max() < 1e-11
