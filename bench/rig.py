"""Recordings as a rig makes them: load, heat, supply and inertia that nobody knows, noise, converters."""

from dataclasses import dataclass

import numpy as np

import emaphm as ema
from bench import foreign
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.estimation.nuisances import COPPER, MAGNETS

NOISE_A, BITS = 0.05, 12
LOAD_NM, HEAT_K = 0.2, 40.0

CURRENT = ("current_A",)
VOLTAGE = (*CURRENT, "voltage_V")
EVERYTHING = (*VOLTAGE, "position_rad", "speed_rad_s")

Range = tuple[float, float]


@dataclass(frozen=True)
class Rig:
    """What is recorded, how, and of an actuator how far off its description: each drawn from its range.

    `load` [N·m] and `heat` [K] add to nominal; `supply` and `inertia` are relative. `controller_noise` [A]
    is the thesis's white noise on the reference current. `features` makes the plant a foreign one.
    """

    channels: tuple[str, ...] = VOLTAGE
    noise: float = NOISE_A
    adc_bits: int | None = BITS
    sample_rate: float = 5000.0
    duration: float = 0.5
    load: Range = (-LOAD_NM, LOAD_NM)
    heat: Range = (-HEAT_K, HEAT_K)
    supply: Range = (0.0, 0.0)
    inertia: Range = (0.0, 0.0)
    controller_noise: float = 0.0
    features: foreign.Features | None = None


BASE = Rig()
"""Noisy, quantised, load and heat unknown; current and line voltage recorded for 0.5 s at 5 kHz."""

IDEAL = Rig(CURRENT, noise=0.0, adc_bits=None, load=(0.0, 0.0), heat=(0.0, 0.0))
"""The current alone, exact, of an actuator as described."""


def actuator_on(rig: Rig, seed: int) -> ema.Actuator:
    """Return the thesis's actuator as it stands on the rig; what other rigs have alike is drawn alike."""
    shares = np.random.default_rng([seed, 1]).random(4)
    load, heat, supply, inertia = (
        low + share * (high - low)
        for share, (low, high) in zip(shares, (rig.load, rig.heat, rig.supply, rig.inertia), strict=True)
    )
    actuator = ema.Actuator.thesis()
    nominal = lumped_parameters(actuator, ("resistance", "torque_constant", "supply", "inertia"))
    return with_lumped_parameters(
        actuator,
        {
            "offset": load,
            "resistance": nominal["resistance"] * (1 + COPPER * heat),
            "torque_constant": nominal["torque_constant"] * (1 + MAGNETS * heat),
            "supply": nominal["supply"] * (1 + supply),
            "inertia": nominal["inertia"] * (1 + inertia),
        },
    )


def recorded(rig: Rig, faults: ema.Faults, seed: int) -> ema.Recording:
    """Return what `rig` records of an actuator with `faults`; all that is random is made from `seed`."""
    actuator, command = actuator_on(rig, seed), ema.Chirp(duration=rig.duration)
    if rig.features is None:
        whole = ema.simulate(
            actuator,
            command,
            faults=faults,
            duration=rig.duration,
            sample_rate=rig.sample_rate,
            noise=rig.noise,
            adc_bits=rig.adc_bits,
            controller_noise=rig.controller_noise,
            seed=seed,
        )
    else:
        whole = foreign.simulate(
            actuator,
            command,
            rig.features,
            faults=faults,
            duration=rig.duration,
            sample_rate=rig.sample_rate,
            noise=rig.noise,
            adc_bits=rig.adc_bits,
            seed=seed,
        )
    return ema.Recording({name: whole[name] for name in ("time_s", "command_rad", *rig.channels)})
