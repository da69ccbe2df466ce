"""Channels that a recording and a model have in common, and the order in which they are compared."""

import numpy as np

from emaphm.actuator import Actuator
from emaphm.errors import MethodError
from emaphm.recording import Recording
from emaphm.recording.schema import RESPONSES
from emaphm.simulation import AVERAGED, Model
from emaphm.simulation.engine.plant import structure_of

SAME_AS = {"current_q_A": "current_A", "voltage_q_V": "voltage_V"}
"""Channels of a field-oriented drive that measure the same line value as another channel."""

TORQUE_CURRENTS = ("current_A", "current_q_A")
"""The equivalent current, and its name in a field-oriented drive."""


def comparable_channels(actuator: Actuator, model: Model = AVERAGED) -> tuple[str, ...]:
    """Return the comparable channels of a model of `actuator`; no voltage without an electrical description.

    Raises
    ------
    MethodError
        The model does not have the actuator's drive.
    """
    observable = model.form(structure_of(actuator)).observable
    return tuple(name for name in observable if name != "voltage_V" or actuator.electrical is not None)


def compared_channels(recording: Recording, actuator: Actuator, model: Model = AVERAGED) -> tuple[str, ...]:
    """Return the channels in which `recording` and a model of `actuator` are compared, the primary one first.

    The equivalent current is primary if it was recorded; otherwise the first channel that varies is primary.

    Raises
    ------
    MethodError
        The model has none of the recorded channels, or does not have the actuator's drive.
    """
    comparable = comparable_channels(actuator, model)
    # A measurement under two names would count twice.
    recorded = [name for name in comparable if name in recording and SAME_AS.get(name, "") not in recording]
    if not recorded:
        available = ", ".join(name for name in RESPONSES if name in recording)
        raise MethodError(
            f"{recording.source}: none of its channels ({available}) can be compared with the {model.name} "
            f"model of actuator '{actuator.name}'; record one of {', '.join(comparable)}"
        )
    varying = [name for name in recorded if name == "current_A" or has_signal(recording, name)]
    chosen = varying or recorded[:1]
    return tuple(sorted(chosen, key=lambda name: name not in TORQUE_CURRENTS))


def has_signal(recording: Recording, name: str) -> bool:
    """Return whether a channel was recorded and is not constant."""
    return name in recording and float(np.ptp(recording[name])) > 0
