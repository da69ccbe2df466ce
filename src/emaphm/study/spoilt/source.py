"""The unspoilt recordings of a known actuator, by the reference model with noise and converters."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.recording import Recording, acquire, full_scales
from emaphm.recording.schema import CURRENTS
from emaphm.simulated_recording import simulate
from emaphm.study.cases import random_faults, small_fault

NOISE_A = 0.05
"""White noise on every current [A rms]."""

ADC_BITS = 12

AMPLITUDE_RAD = 5e-3
STOP_HZ = 15.0

CHANNELS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "current": ("current_A",),
        "voltage": ("current_A", "voltage_V"),
        "motion": ("current_A", "voltage_V", "position_rad", "speed_rad_s"),
        "phases": ("current_a_A", "current_b_A", "current_c_A", "angle_rad"),
    }
)
"""Sets of channels that are recorded in addition to time and command, by name."""

FAULTS: Mapping[str, Faults] = MappingProxyType(
    {
        "healthy": Faults(),
        "friction": Faults(friction=0.3),
        "short": small_fault("short", 0.2, 1),
        "random 1": random_faults(1),
        "random 2": random_faults(2),
    }
)
"""True faults of the actuator, by name."""


@dataclass(frozen=True)
class SpoiltChirp:
    """A chirp from standstill to `STOP_HZ`: its duration [s] and sampling rate [Hz]."""

    duration: float = 0.5
    sample_rate: float = 5000.0


CHIRP = SpoiltChirp()
"""Default chirp."""


def recorded(
    actuator: Actuator, faults: Faults, manoeuvre: SpoiltChirp, channels: tuple[str, ...], seed: int
) -> Recording:
    """Return the unspoilt recording of `actuator` with `faults`: time, command and `channels`."""
    exact = simulate(
        actuator,
        Chirp(AMPLITUDE_RAD, 0.0, STOP_HZ, manoeuvre.duration),
        faults=faults,
        duration=manoeuvre.duration,
        sample_rate=manoeuvre.sample_rate,
        seed=seed,
    )
    # The angle is measured by a fine encoder, and not by a converter whose range covers all turns.
    scales = {name: scale for name, scale in full_scales(actuator).items() if name != "angle_rad"}
    noise = {name: NOISE_A for name in channels if name in CURRENTS}
    selected = Recording({name: exact[name] for name in ("time_s", "command_rad", *channels)})
    return acquire(selected, noise=noise, adc_bits=ADC_BITS, full_scale=scales, seed=seed)
