"""Recordings of a rig: with noise, converters, and an actuator that deviates from its description."""

from functools import partial

import numpy as np

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.lumped_parameters import lumped_parameters, with_lumped_parameters
from emaphm.arrays import Array
from emaphm.estimation.space.nuisances import COPPER, MAGNETS
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.study.rig import Manoeuvre, Rig, VaryingLoad


def actuator_on(rig: Rig, actuator: Actuator, seed: int) -> Actuator:
    """Return `actuator` with the unknown quantities of the rig, drawn with `seed`.

    Rigs with the same range have the same draw from it: each quantity has a fixed place in the stream.
    """
    shares = np.random.default_rng([seed, 1]).random(4)
    load, heat, supply, inertia = (
        low + share * (high - low)
        for share, (low, high) in zip(shares, (rig.load, rig.heat, rig.supply, rig.inertia), strict=True)
    )
    actuator = unit_on(rig, actuator, seed)
    nominal = lumped_parameters(actuator, ("offset", "resistance", "torque_constant", "supply", "inertia"))
    return with_lumped_parameters(
        actuator,
        {
            "offset": nominal["offset"] + load,
            "resistance": nominal["resistance"] * (1 + COPPER * heat),
            "torque_constant": nominal["torque_constant"] * (1 + MAGNETS * heat),
            "supply": nominal["supply"] * (1 + supply),
            "inertia": nominal["inertia"] * (1 + inertia),
        },
    )


def unit_on(rig: Rig, actuator: Actuator, seed: int) -> Actuator:
    """Return a unit of the description `actuator`, drawn with `seed` within the tolerances of the rig."""
    tolerances = rig.tolerances
    if tolerances is None:
        return actuator
    described = lumped_parameters(actuator, tolerances.names)
    normal = np.random.default_rng([seed, 2]).standard_normal(len(tolerances.names))
    return with_lumped_parameters(
        actuator,
        {
            name: described[name] * float(np.exp(deviation * share))
            for (name, deviation), share in zip(tolerances.deviations.items(), normal, strict=True)
        },
    )


def load_at(load: VaryingLoad, time: Array, duration: float) -> Array:
    """Return the time-varying part of a load [N·m] at `time` [s], in the same shape."""
    swinging = load.swing * np.sin(2 * np.pi * load.frequency * time)
    there = _shift(load, time - duration / 2)
    if load.lasts is not None:
        there = there - _shift(load, time - duration / 2 - load.lasts)
    return np.asarray(swinging + load.drift * time + load.step * there)


def _shift(load: VaryingLoad, since: Array) -> Array:
    """Return the share of a step that has been reached at the times `since` its middle [s]."""
    return np.clip(since / load.rise + 0.5, 0.0, 1.0) if load.rise else np.asarray(since >= 0, float)


def recorded(rig: Rig, actuator: Actuator, manoeuvre: Manoeuvre, faults: Faults, seed: int) -> Recording:
    """Return the recording by `rig` of `actuator` with `faults`; all random draws come from `seed`."""
    duration = manoeuvre.duration if rig.duration is None else rig.duration
    rate = manoeuvre.sample_rate if rig.sample_rate is None else rig.sample_rate
    command = manoeuvre.chirp(actuator, duration)
    present, load = actuator_on(rig, actuator, seed), rig.varying_load
    if rig.foreign is None:
        whole = simulate(
            present if load is None else with_lumped_parameters(present, {"hinge": load.hinge}),
            command,
            load=0.0 if load is None else partial(load_at, load, duration=duration),
            faults=faults,
            duration=duration,
            sample_rate=rate,
            noise=rig.noise,
            adc_bits=rig.adc_bits,
            controller_noise=rig.controller_noise,
            seed=seed,
        )
    else:
        from emaphm.study import foreign_plant

        whole = foreign_plant.simulate(
            present,
            command,
            rig.foreign,
            faults=faults,
            duration=duration,
            sample_rate=rate,
            noise=rig.noise,
            adc_bits=rig.adc_bits,
            seed=seed,
        )
    return Recording({name: whole[name] for name in ("time_s", "command_rad", *rig.channels)})
