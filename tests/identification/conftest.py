"""Recordings that several files diagnose, simulated once."""

import numpy as np
import pytest

from emaphm.actuator import Chirp, Faults
from emaphm.recording import Recording
from emaphm.rig import simulate
from identification.cases import SINGLES, THESIS, reference_recordings


@pytest.fixture(scope="session")
def healthy() -> Recording:
    """Return every channel of the healthy actuator, with the sensor noise of the demonstration."""
    return simulate(THESIS, Chirp(), noise=0.05)


@pytest.fixture(scope="session")
def shorted() -> Recording:
    """Return every channel of an actuator with a third of phase b shorted."""
    return simulate(THESIS, Chirp(), faults=Faults(short_b=0.3), noise=0.05)


@pytest.fixture(scope="session")
def singles() -> list[Recording]:
    """Return recordings of the ten single faults, noise-free."""
    return reference_recordings(np.stack([faults.vector for faults in SINGLES.values()]))
