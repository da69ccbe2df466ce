"""Simulated recordings: an actuator is driven through a manoeuvre and recorded as on a real rig."""

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator, Command, Faults, Load
from emaphm.actuator.argument import check_actuator
from emaphm.actuator.channels import Sampling
from emaphm.actuator.commands import rest_position, sample_held
from emaphm.actuator.sensors import IDEAL
from emaphm.arrays import Array
from emaphm.errors import MethodError, RecordingError, SignalError
from emaphm.random_streams import check_seed, stream
from emaphm.recording import Recording, acquire, full_scales
from emaphm.recording.acquisition import check_bits
from emaphm.recording.schema import CURRENTS
from emaphm.recording.signal_rows import signal_rows
from emaphm.simulation import REFERENCE, Initial, Inputs, Model, Plant, model_named, run
from emaphm.simulation.laws.sensors import rounded, sensed

MOST_STEPS = 300_000_000
"""Longest run: five minutes of manoeuvre at the reference model's step, some 10 GB of inputs."""

MOST_ROWS = 20_000_000
"""Longest recording: some 3 GB of signals."""


def simulate(
    actuator: Actuator,
    command: Command,
    *,
    faults: Faults = Faults(),  # noqa: B008 - frozen
    model: str = "reference",
    duration: float = 0.5,
    sample_rate: float = 5000.0,
    load: Load = 0.0,
    noise: float = 0.0,
    adc_bits: int | None = None,
    controller_noise: float = 0.0,
    sampling: Sampling = "mean",
    initial_position: float | None = None,
    seed: int = 0,
) -> Recording:
    """Return the recording, with all signals, of `actuator` as it follows `command` from rest.

    The errors of the described sensors are applied first, then `noise` and the quantisation by `adc_bits`.

    Parameters
    ----------
    actuator
        Description with the parameters of the simulated unit.
    command
        Function of time [s], (n,), that returns the user's position [rad; m if linear], (n,).
    faults
        Faults of the unit; healthy by default.
    model
        "reference", "monitor" or "averaged". The reference model also returns the currents and voltages of
        the phases, and the other two equivalent currents.
    duration, sample_rate
        Duration [s] and sampling rate [Hz] of the recording.
    load
        Load at the motor shaft [N·m; N if linear], a number or a function of time; recorded as `load_Nm`
        unless it is 0.
    noise
        Sensor noise on every recorded current, rms [A].
    adc_bits
        Resolution of the converters [bit], over the ranges of `full_scales`; no quantisation by default.
    controller_noise
        White noise on the reference current, rms [A] per step (thesis 4.1); for the reference model only.
    sampling
        Whether rows are means over the sample interval, or instantaneous values.
    initial_position
        Initial position of the shaft, at rest, at the user [rad; m if linear]. Default: the position to which
        the command is relative (its `about`), or 0 for a command without such a position.
    seed
        Seed of all noise.

    Raises
    ------
    FaultError
        The friction is lower than the actuator permits (`emaphm.actuator.faults.lower_bounds`).
    ActuatorError
        `actuator` is no `Actuator`.
    MethodError, SignalError, RecordingError
        `command` is no command; the model or the sampling is unknown; the simulation did not stay finite; a
        duration, rate or noise is invalid; the command does not move the shaft; the recording would be too
        short, or would start beyond the end stops.
    """
    check_actuator(actuator)
    if not callable(command):
        raise SignalError(f"no command but a {type(command).__name__}; give one such as Chirp()")
    chosen = model_named(model)
    first = rest_position(command, initial_position)
    actuator.mechanics.check_start(first)
    _check(chosen, duration, sample_rate, noise, adc_bits, controller_noise, seed)
    sent = actuator.channels.command_held
    inputs = Inputs.of(
        sample_held(command, 1 / sample_rate, sent),
        load,
        samples=round(duration * sample_rate),
        interval=1 / sample_rate,
        step=chosen.step_for(actuator),
        sampling=sampling,
        noise=controller_noise,
        seed=seed,
    )
    start = Initial(first / actuator.mechanics.gear_ratio)
    ran = run(chosen, Plant.of(actuator, faults.vector), inputs, start)
    signals = _sensed(ran, actuator, inputs.interval, seed)
    if actuator.electrical is None:
        del signals["voltage_V"]  # an ideal current loop has no modelled voltage
    commanded = command(inputs.time_s) if sent else _rows(command, inputs)
    rows = {"time_s": inputs.time_s, "command_rad": commanded, **signals}
    if np.all(rows["command_rad"] == first):
        raise RecordingError(f"nothing was commanded: the command is {first:g} throughout; it must move")
    if callable(load) or load:
        rows["load_Nm"] = _rows(load, inputs) if callable(load) else np.full(inputs.samples, float(load))
    exact = Recording(rows, sampling, f"simulated ({model} model)")
    if not noise and adc_bits is None:
        return exact
    currents = [name for name in CURRENTS if name in exact]
    ranges = full_scales(actuator) if adc_bits is not None else None
    return acquire(
        exact, noise=dict.fromkeys(currents, noise), adc_bits=adc_bits, full_scale=ranges, seed=seed
    )


def _sensed(signals: dict[str, Array], actuator: Actuator, interval: float, seed: int) -> dict[str, Array]:
    """Return the signals, (samples,) each, with errors, noise and resolution of the actuator's sensors."""
    shown = {}
    for name, signal in signals.items():
        sensor = actuator.sensors.of(name)
        if sensor == IDEAL:
            shown[name] = signal
            continue
        noise = stream(seed, "noise of the sensor", name).normal(0.0, sensor.noise, signal.size)
        shown[name] = rounded(sensed(signal, sensor, interval, noise), sensor.resolution)
    return shown


def _check(
    model: Model,
    duration: float,
    sample_rate: float,
    noise: float,
    adc_bits: int | None,
    controller_noise: float,
    seed: int,
) -> None:
    """Refuse invalid settings before the simulation starts."""
    check_seed(seed)
    if not (0 < duration < np.inf and 0 < sample_rate < np.inf):
        raise SignalError(f"duration ({duration:g} s) and sample rate ({sample_rate:g} Hz) must be above 0")
    if not 0 <= noise < np.inf:
        raise RecordingError(f"noise of {noise:g} A is no rms; give 0 or more")
    if duration > MOST_STEPS * model.step:
        raise SignalError(
            f"{duration:g} s are too long for the {model.name} model; "
            f"{MOST_STEPS * model.step:g} s are possible"
        )
    if duration * sample_rate > MOST_ROWS:
        raise SignalError(
            f"{duration * sample_rate:.3g} rows are too many, {MOST_ROWS:g} are possible; sample slower"
        )
    if controller_noise and model is not REFERENCE:
        raise MethodError(f"the {model.name} model's controller has no noise; use the reference model")
    if adc_bits is not None:
        check_bits(adc_bits)


def _rows(signal: Command, inputs: Inputs) -> NDArray[np.float64]:
    """Return the recorded rows of a given signal: instantaneous values, or means over the sample interval."""
    if inputs.sampling == "instant":
        return signal(inputs.time_s)
    return signal_rows(signal, inputs.time_s, inputs.interval)
