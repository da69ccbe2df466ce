"""Recordings of known faults, simulated in batches, and errors and coverage of diagnoses."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from emaphm.actuator import NAMES, Actuator, Chirp, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis, error_percent
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate
from emaphm.simulation import REFERENCE, Inputs, simulate_batch

THESIS = Actuator.thesis()
USUAL = THESIS.nuisances.estimated
"""The nuisances that are always estimated; if they are named, no further nuisance is searched."""

HEALTHY = Faults().vector
INTERVAL = 2e-4
"""The acquisition of docs/physics.md, section 7: 5 kHz."""

SHORTED = np.array([1.0, 1.0, 0.7, 0.7, 0.7, 1.0, 1.0, 1.0])
"""Upper ends of the faults for which the averaged model is valid (docs/physics.md, section 5)."""


def drawn(count: int, seed: int) -> Array:
    """Return random fault vectors, shape (count, 8), each component uniform up to `SHORTED`."""
    return np.asarray(np.random.default_rng(seed).random((count, 8)) * SHORTED)


def reference_recordings(faults: ArrayLike, *, noise: float = 0.0, duration: float = 0.5) -> list[Recording]:
    """Return recordings of the thesis's actuator by the reference model on a chirp under `faults` (n, 8).

    Only the current is recorded, with independent white noise of the given rms [A]. The chirp is that of the
    thesis, within `duration` seconds.
    """
    command, samples = Chirp(duration=duration), round(duration / INTERVAL)
    inputs = Inputs.of(command, samples=samples, interval=INTERVAL, step=REFERENCE.step)
    exact = {"time_s": inputs.time_s, "command_rad": inputs.rows(inputs.command)}
    currents = simulate_batch(REFERENCE, THESIS, faults, inputs)
    recordings = [Recording(exact | {"current_A": current}) for current in currents]
    if not noise:
        return recordings
    return [acquire(r, noise={"current_A": noise}, seed=i) for i, r in enumerate(recordings)]


def differing(actuator: Actuator, **factors: float) -> Actuator:
    """Return an actuator with lumped parameters `factors` times as large."""
    described = lumped_parameters(actuator, tuple(factors))
    return with_lumped_parameters(
        actuator, {name: described[name] * factor for name, factor in factors.items()}
    )


def on_a_rig(
    actuator: Actuator, faults: Faults, duration: float, noise: float = 0.05, seed: int = 0
) -> Recording:
    """Return current and line voltage of `actuator` on a chirp, with `noise` [A] and 12-bit converters."""
    command = Chirp(duration=duration)
    recording = simulate(
        actuator, command, faults=faults, duration=duration, noise=noise, adc_bits=12, seed=seed
    )
    return Recording({name: recording[name] for name in ("time_s", "command_rad", "current_A", "voltage_V")})


def errors_percent(truths: ArrayLike, diagnoses: Sequence[Diagnosis]) -> Array:
    """Return the error [%] of each diagnosis."""
    return error_percent(truths, np.stack([diagnosis.faults.vector for diagnosis in diagnoses]))


def covered(truth: ArrayLike, diagnosis: Diagnosis) -> list[bool]:
    """Return for each component whether its 95 % interval holds the truth; the phase is on a circle."""
    inside = []
    for name, true in zip(NAMES, np.asarray(truth, float), strict=True):
        low, high = diagnosis.interval[name]
        turns = (-1, 0, 1) if name == "eccentricity_phase" else (0,)
        inside.append(any(low <= true + turn <= high for turn in turns))
    return inside
