"""Recorded supply voltage as a known parameter of a drive with three phases."""

from collections.abc import Container

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.errors import RecordingError
from emaphm.recording import Recording


def makes_supply_known(channels: Container[str], actuator: Actuator) -> bool:
    """Return whether `channels` contain the supply voltage and it determines the drive's supply.

    It does so for a drive with three phases and without a source resistance: a supply with a source
    resistance is described by its open-circuit voltage, which was not recorded.
    """
    soft = actuator.drive is not None and actuator.drive.source_resistance
    return "supply_V" in channels and actuator.three_phases and not soft


def with_recorded_supply(actuator: Actuator, recording: Recording) -> Actuator:
    """Return `actuator` with the mean of the recorded supply if it determines the drive's supply.

    Raises
    ------
    RecordingError
        The mean is not positive.
    """
    if not makes_supply_known(recording, actuator):
        return actuator
    supply = float(np.mean(recording["supply_V"]))
    if supply <= 0:
        raise RecordingError(
            f"{recording.source}: supply_V is {supply:.3g} V on average, but a supply is positive; correct "
            "its sign and unit, or leave that column out"
        )
    return with_lumped_parameters(actuator, {"supply": supply})
