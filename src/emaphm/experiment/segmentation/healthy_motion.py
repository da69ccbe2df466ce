"""Simulated motion of the healthy actuator for a recorded command of any length."""

from collections.abc import Callable

import numpy as np

from emaphm.actuator import Actuator, Command
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.recorded_supply import with_recorded_supply
from emaphm.estimation.rows.initial_state import initial_state
from emaphm.recording import Recording
from emaphm.simulation import AVERAGED, Initial, Inputs, Plant, observe_batch

PIECE_S = 20.0
"""Longest run [s]; the memory of a run depends on the model's time steps, not on the rows."""


def healthy_position(recording: Recording, actuator: Actuator) -> Array:
    """Return the user's position [rad] by the averaged model of the healthy actuator, (samples,).

    The command is simulated in pieces of `PIECE_S`. A piece starts from position and speed of the last row of
    the piece before, with the backlash gap centred and the controller's integrals 0, which shifts the motion
    by less than the gap. A piece with constant inputs that starts at rest is not simulated.
    """
    actuator = with_recorded_supply(actuator, recording)
    plant = Plant.of(actuator, HEALTHY.vector[np.newaxis])
    driving, start = DrivingSignals.of(recording, actuator), initial_state(recording, actuator)
    command, inputs_vary = recording["command_rad"], callable(driving.load) or driving.enabled is not None
    interval = recording.interval_s
    position = np.empty(recording.samples)
    most, rests = max(1, int(PIECE_S / interval)), False
    for first in range(0, recording.samples, most):
        count, begin = min(most, recording.samples - first), first * interval
        if rests and not inputs_vary and np.ptp(command[first - 1 : first + count + 1]) == 0:
            position[first : first + count] = position[first - 1]
            continue
        inputs = Inputs.of(
            _shifted(driving.command, begin),
            _shifted(driving.load, begin) if callable(driving.load) else driving.load,
            samples=count,
            interval=interval,
            step=AVERAGED.step_for(actuator),
            sampling=recording.sampling,
            enabled=_shifted(driving.enabled, begin) if driving.enabled is not None else None,
        )
        rows, speed = observe_batch(AVERAGED, plant, inputs, start, channels=("position_rad", "speed_rad_s"))[
            0
        ]
        position[first : first + count] = rows
        rests = not np.any(speed[-2:])
        start = Initial(float(rows[-1]) / actuator.mechanics.gear_ratio, float(speed[-1]), start.rotor_offset)
    return position


def _shifted(signal: Command, begin: float) -> Callable[[Array], Array]:
    """Return a signal of time [s] as a function of the time since `begin` [s]."""
    return lambda times: signal(times + begin)
