"""Motion of the healthy actuator for a recorded command of any length."""

from collections.abc import Callable

import numpy as np

from emaphm.actuator import Actuator, Command
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.initial_state import initial_state
from emaphm.estimation.recorded_supply import with_recorded_supply
from emaphm.recording import Recording
from emaphm.simulation import AVERAGED, Initial, Inputs, Plant, observe_batch

PIECE_S = 20.0
"""Longest run [s]: the steps of a model need memory."""


def healthy_position(recording: Recording, actuator: Actuator) -> Array:
    """Return the user's position [rad] by the averaged model of the healthy actuator, (samples,).

    The recording is simulated in pieces of `PIECE_S`. Each piece starts from position and speed of the last
    row before it, with the motor in the middle of the backlash gap and the controller's integrals at 0; this
    shifts the motion by less than the gap. A piece that starts at rest and has constant inputs is not
    simulated.
    """
    actuator = with_recorded_supply(actuator, recording)
    plant = Plant.of(actuator, HEALTHY.vector[np.newaxis])
    driving, start = DrivingSignals.of(recording), initial_state(recording, actuator)
    command, others_change = recording["command_rad"], callable(driving.load) or driving.enabled is not None
    interval = recording.interval_s
    position = np.empty(recording.samples)
    most, rests = max(1, int(PIECE_S / interval)), False
    for first in range(0, recording.samples, most):
        count, begin = min(most, recording.samples - first), first * interval
        if rests and not others_change and np.ptp(command[first - 1 : first + count + 1]) == 0:
            position[first : first + count] = position[first - 1]
            continue
        inputs = Inputs.of(
            _from(driving.command, begin),
            _from(driving.load, begin) if callable(driving.load) else driving.load,
            samples=count,
            interval=interval,
            step=AVERAGED.step_for(actuator),
            sampling=recording.sampling,
            enabled=_from(driving.enabled, begin) if driving.enabled is not None else None,
        )
        rows, speed = observe_batch(AVERAGED, plant, inputs, start, channels=("position_rad", "speed_rad_s"))[
            0
        ]
        position[first : first + count] = rows
        rests = not np.any(speed[-2:])
        start = Initial(float(rows[-1]) / actuator.mechanics.gear_ratio, float(speed[-1]), start.rotor_offset)
    return position


def _from(signal: Command, begin: float) -> Callable[[Array], Array]:
    """Return a signal as a function of the time since `begin` [s]."""
    return lambda times: signal(times + begin)
