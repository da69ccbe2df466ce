"""How right the identification is where a rig is no simulation: load, heat, noise, converters."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import emaphm as ema
from emaphm.actuator import NAMES
from emaphm.actuator.faults import HEALTHY
from emaphm.actuator.totals import totals, with_totals
from emaphm.identification.nuisance import COPPER, MAGNETS

Array = NDArray[np.float64]

CASES = 100
NOISE_A, BITS = 0.05, 12
LOAD_NM, HEAT_K = 0.2, 40.0

CURRENT = ("current_A",)
VOLTAGE = (*CURRENT, "voltage_V")
EVERYTHING = (*VOLTAGE, "position_rad", "speed_rad_s")


@dataclass(frozen=True)
class Setting:
    """What is recorded, what is estimated besides (the default where None), and whether there are faults."""

    name: str
    channels: tuple[str, ...]
    nuisances: tuple[str, ...] | None = None
    healthy: bool = False


SETTINGS = (
    Setting("current, load and temperature estimated (default)", CURRENT),
    Setting("current and voltage, default", VOLTAGE),
    Setting("current, voltage, position, speed, default", EVERYTHING),
    Setting("current and voltage, nothing estimated besides", VOLTAGE, ()),
    Setting("healthy, current, default", CURRENT, healthy=True),
    Setting("healthy, current and voltage, default", VOLTAGE, healthy=True),
)


def recorded(setting: Setting, seed: int) -> tuple[Array, ema.Recording]:
    """Return faults (8,), and their recording by a rig whose load and temperature nobody knows."""
    rng = np.random.default_rng(seed)
    faults = rng.random(8)
    faults[2:5] *= 0.7
    if setting.healthy:
        faults = HEALTHY.vector
    load, warmer = rng.uniform(-LOAD_NM, LOAD_NM), rng.uniform(-HEAT_K, HEAT_K)
    actuator = ema.Actuator.thesis()
    nominal = totals(actuator, ("resistance", "torque_constant"))
    on_rig = with_totals(
        actuator,
        {
            "offset": load,
            "resistance": nominal["resistance"] * (1 + COPPER * warmer),
            "torque_constant": nominal["torque_constant"] * (1 + MAGNETS * warmer),
        },
    )
    whole = ema.simulate(
        on_rig, ema.Chirp(), faults=ema.Faults(*faults), noise=NOISE_A, adc_bits=BITS, seed=seed
    )
    kept = ("time_s", "command_rad", *setting.channels)
    return faults, ema.Recording({name: whole[name] for name in kept})


def holds(interval: tuple[float, float], truth: float, name: str) -> bool:
    """Return whether an interval holds the truth; a phase's on the circle."""
    turns = (-1, 0, 1) if name == "eccentricity_phase" else (0,)
    return any(interval[0] <= truth + turn <= interval[1] for turn in turns)


def report() -> Iterator[str]:
    """Yield the lines of the page's section."""
    yield "\n## As on a rig\n"
    yield (
        f"{CASES} recordings each, {NOISE_A:g} A of noise on the current, all channels through {BITS}-bit "
        f"converters, a load anywhere within ±{LOAD_NM:g} N·m and windings within ±{HEAT_K:g} K, neither "
        "recorded; random faults as above, or none. Alarms: recordings with a component called degraded.\n"
    )
    yield (
        "| recorded, estimated | error: median / 95th percentile / worst, % | called explained "
        "| alarms | median time, s |"
    )
    yield "| --- | --- | ---: | ---: | ---: |"
    coverage = []
    for setting in SETTINGS:
        errors, covered, explained, alarms, seconds = [], [], [], [], []
        for seed in range(CASES):
            faults, recording = recorded(setting, seed)
            found = ema.diagnose(
                recording, ema.Actuator.thesis(), nuisances=setting.nuisances, seed=seed, workers=1
            )
            errors.append(float(ema.error_percent(faults, found.faults.vector)))
            covered.append([holds(found.interval[name], faults[i], name) for i, name in enumerate(NAMES)])
            explained.append(found.explained)
            alarms.append(any(one.verdict == "degraded" for one in found.components.values()))
            seconds.append(found.seconds)
        coverage.append((setting.name, np.mean(covered, axis=0)))
        middle, most = np.median(errors), np.percentile(errors, 95)
        yield (
            f"| {setting.name} | {middle:.2f} / {most:.2f} / {max(errors):.2f} "
            f"| {100 * np.mean(explained):.0f} % | {100 * np.mean(alarms):.0f} % | {np.median(seconds):.2f} |"
        )
    yield "\nShare of these recordings whose 95 % interval holds the truth:\n"
    yield f"| recorded, estimated | {' | '.join(NAMES)} |"
    yield f"| --- |{' ---: |' * len(NAMES)}"
    for name, shares in coverage:
        yield f"| {name} | {' | '.join(f'{100 * share:.0f} %' for share in shares)} |"
