"""Which channels a recording and a model have in common, and the order in which they are compared."""

import numpy as np

from emaphm.actuator import Actuator
from emaphm.errors import MethodError
from emaphm.recording import Recording
from emaphm.recording.schema import RESPONSES
from emaphm.simulation import AVERAGED, Model
from emaphm.simulation.engine.plant import structure_of

SAME_AS = {"current_q_A": "current_A", "voltage_q_V": "voltage_V"}
"""Channels of a field-oriented drive that are the same line value as another."""

TORQUE_CURRENTS = ("current_A", "current_q_A")
"""The equivalent current, and its name where a field-oriented drive gives it."""


def comparable_channels(actuator: Actuator, model: Model = AVERAGED) -> tuple[str, ...]:
    """Return the channels that a model of `actuator` has to compare: no voltage without its windings.

    Raises
    ------
    MethodError
        The model does not know the actuator's drive.
    """
    observable = model.form(structure_of(actuator)).observable
    return tuple(name for name in observable if name != "voltage_V" or actuator.electrical is not None)


def compared_channels(recording: Recording, actuator: Actuator, model: Model = AVERAGED) -> tuple[str, ...]:
    """Return the channels of `recording` that a model of `actuator` is compared in, the primary one first.

    The equivalent current is primary where it was recorded, else the first channel that varies.

    Raises
    ------
    MethodError
        The model has none of the recorded channels, or does not know the actuator's drive.
    """
    comparable = comparable_channels(actuator, model)
    # One measurement by two names would count twice.
    recorded = [name for name in comparable if name in recording and SAME_AS.get(name, "") not in recording]
    if not recorded:
        held = ", ".join(name for name in RESPONSES if name in recording)
        raise MethodError(
            f"{recording.source}: of what it holds ({held}) the {model.name} model of actuator "
            f"'{actuator.name}' has nothing to compare; record one of {', '.join(comparable)}"
        )
    varying = [name for name in recorded if name == "current_A" or has_signal(recording, name)]
    chosen = varying or recorded[:1]
    return tuple(sorted(chosen, key=lambda name: name not in TORQUE_CURRENTS))


def has_signal(recording: Recording, name: str) -> bool:
    """Return whether a channel was recorded, and is more than an idle column of one value."""
    return name in recording and float(np.ptp(recording[name])) > 0
