"""The Gaussian low-pass that removes false minima, against the Gaussian filter of SciPy."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from emaphm.estimation.global_search.smoothing import gaussian_filter


@pytest.mark.parametrize("deviation", [0.1, 0.3, 1.0, 4.0, 6.2, 300.0])
def test_the_low_pass_is_the_gaussian_filter_of_scipy(deviation: float) -> None:
    values = np.random.default_rng(2).random((4, 2, 130))
    expected = gaussian_filter1d(values, deviation, axis=-1, mode="nearest")
    np.testing.assert_allclose(gaussian_filter(values, deviation), expected, rtol=0, atol=1e-13)
