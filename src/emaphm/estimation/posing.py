"""Construction of a `Problem` from a recording: model inputs, initial state, and the compared rows."""

from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.estimation.compared_channels import compared_channels
from emaphm.estimation.driving_signals import DrivingSignals
from emaphm.estimation.problem import Problem
from emaphm.estimation.recorded_supply import with_recorded_supply
from emaphm.estimation.rows.initial_state import initial_state, shows_start
from emaphm.estimation.rows.start import unknown_start
from emaphm.estimation.sensors.counts import shared_errors, visible_count
from emaphm.estimation.signal_size import signal_size
from emaphm.estimation.uncertainty.model_error import row_errors
from emaphm.recording import Recording, with_equivalent_current
from emaphm.simulation import AVERAGED, Model


def problem_of(
    recording: Recording,
    actuator: Actuator,
    model: Model = AVERAGED,
    workers: int | None = None,
    channels: tuple[str, ...] | None = (),
) -> Problem:
    """Return the problem of reproducing `recording` by `model` of `actuator`.

    `channels` are the compared channels: if empty, the primary channel alone; if None, all recorded channels
    that vary and that the model simulates.

    Raises
    ------
    MethodError
        The model simulates none of the recorded channels.
    RecordingError
        A recorded supply is not positive.
    """
    recording = with_equivalent_current(recording, actuator)
    actuator = with_recorded_supply(actuator, recording)
    driving = DrivingSignals.of(recording, actuator)
    comparable = compared_channels(recording, actuator, model)
    compared = comparable if channels is None else channels or comparable[:1]
    counts = {name: count for name in compared if (count := visible_count(recording[name])) > 0}
    errors = {name: shared_errors(recording[name], counts.get(name, 0.0)) for name in compared}
    problem = Problem(
        actuator,
        model,
        driving,
        driving.inputs(model.step_for(actuator)),
        initial_state(recording, actuator),
        recording.channels,
        compared,
        temperature_rise_K=_temperature_rise(recording, actuator),
        workers=workers,
        counts=counts,
        shared_errors={name: shared for name, shared in errors.items() if shared is not None},
    )
    all_channels = problem.observing(comparable)
    unknown = unknown_start(all_channels, shown=shows_start(recording, actuator))
    problem = replace(
        problem,
        start=replace(problem.start, gap=unknown.gap),
        model_error=row_errors(problem),
        unusable=unknown.masks(all_channels.samples, all_channels.channels),
        unknown_start=unknown,
    )
    # Before the first search, each residual is taken relative to the size of its channel.
    return problem.weighted([signal_size(name, recording[name]) for name in problem.channels])


def _temperature_rise(recording: Recording, actuator: Actuator) -> float:
    """Return the mean recorded temperature above the nominal one [K]; 0 if it was not recorded."""
    if "temperature_K" not in recording or actuator.electrical is None:
        return 0.0
    return float(np.mean(recording["temperature_K"])) - actuator.electrical.temperature
