"""Which motions are slow: the fitted model's derivatives by a gain are not the reference model's there."""

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Chirp, Command, Sine
from emaphm.estimation.posing import problem_of
from emaphm.estimation.uncertainty.local_covariance import moves_slowly
from emaphm.recording import Recording


@pytest.mark.parametrize(
    ("command", "slow"),
    [(Sine(5e-3, 2.0), True), (Sine(2e-3, 5.0), True), (Sine(5e-3, 8.0), False), (Chirp(), False)],
)
def test_slow_is_what_makes_derivatives_differ(command: Command, *, slow: bool) -> None:
    # The ratio of the derivatives by a gain was 0.61 and 0.81 of the first two, 0.98 and 0.94 of the others.
    time = np.arange(1000) / 2000
    recording = Recording({"time_s": time, "command_rad": command(time), "current_A": np.sin(9 * time)})
    assert moves_slowly(problem_of(recording, THESIS)) is slow
