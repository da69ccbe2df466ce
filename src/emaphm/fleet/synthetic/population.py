"""Populations of synthetic fleets: wear of the components, stress, and check-flight rig."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.stress import Stress


@dataclass(frozen=True)
class Wear:
    """How one component degrades over the units of a fleet.

    Parameters
    ----------
    laws
        Names of `growth.LAWS` with their shares of the units.
    share
        Share of the units in which the component degrades.
    life
        Median life over the units, to the limit under nominal stress [h].
    spread
        Standard deviation of the logarithm of the life over the units.
    limit
        Deviation from healthy at which the component fails.
    """

    laws: Mapping[str, float]
    share: float
    life: float
    limit: float
    spread: float = 0.3


@dataclass(frozen=True)
class StressModel:
    """Stress of a unit; its ageing rate, relative to nominal, is 2^(ΔT/d) (1 + l)^3.

    ΔT [K] is the deviation of the ambient temperature from nominal; each `doubling` d [K] doubles the ageing
    rate (Arrhenius' law over a narrow range). l is the relative deviation of the load, with the exponent of
    bearing life (ISO 281). Each has a part of the unit's mission and a part of each interval between two
    check flights, both normal with the standard deviations below. Nominal are `nominal_K` [K] and
    `nominal_load` [N·m].
    """

    nominal_K: float = 288.0
    nominal_load: float = 0.1
    doubling: float = 40.0
    mission_K: float = 8.0
    flight_K: float = 10.0
    mission_load: float = 0.06
    flight_load: float = 0.06

    def drawn(self, mission: tuple[float, float], count: int, random: np.random.Generator) -> Array:
        """Return ΔT [K] and l of `count` intervals of a unit with the mission (ΔT, l), (2, count)."""
        heat, load = random.standard_normal((2, count))
        return np.stack([mission[0] + self.flight_K * heat, mission[1] + self.flight_load * load])

    def ageing(self, heat: Array, load: Array) -> Array:
        """Return the ageing rate [-] at ΔT = `heat` [K] and l = `load`, arrays of the same shape."""
        return np.asarray(2 ** (heat / self.doubling) * np.maximum(1 + load, 0.0) ** 3)

    def recorded(self, heat: float, load: float) -> Stress:
        """Return ΔT = `heat` [K] and l = `load` as an operator records them."""
        return Stress(self.nominal_load * max(1 + load, 0.0), self.nominal_K + heat)

    def deviations(self, stress: Stress) -> tuple[float, float]:
        """Return ΔT [K] and l of a recorded stress, the inverse of `recorded`; an unknown value is 0."""
        heat = 0.0 if stress.temperature is None else stress.temperature - self.nominal_K
        load = 0.0 if stress.load is None else stress.load / self.nominal_load - 1
        return heat, load


@dataclass(frozen=True)
class CheckFlightRig:
    """Recording of a check flight, and its unknown conditions; all values are assumptions.

    The command is a chirp of `amplitude` [rad] up to `stop_hz` [Hz] for `duration` [s]. Current and line
    voltage are recorded, with white `noise` on the current [A rms] and converters of `adc_bits`. A diagnosis
    does not know the constant load, within ± `load` [N·m], the temperature of the windings, within ± `heat`
    [K] of the ambient, and the supply, within ± `supply` of nominal, relative.
    """

    amplitude: float = 5e-3
    stop_hz: float = 15.0
    duration: float = 0.5
    sample_rate: float = 5000.0
    noise: float = 0.05
    adc_bits: int = 12
    load: float = 0.2
    heat: float = 15.0
    supply: float = 0.02


@dataclass(frozen=True)
class Population:
    """A population of units: the wear of each component, the stress, the rig.

    `drift` is the standard deviation over a life of a level's deviation from its law, a Wiener process;
    `new_level` is that of a new component's level about healthy.
    """

    name: str
    wear: Mapping[str, Wear]
    stress: StressModel = field(default_factory=StressModel)
    rig: CheckFlightRig = field(default_factory=CheckFlightRig)
    drift: float = 0.01
    new_level: float = 0.01


def _of(name: str, **wear: Wear) -> Population:
    return Population(name, MappingProxyType(wear))


FLEET = _of(
    "fleet",
    friction=Wear(MappingProxyType({"linear": 0.5, "exponential": 0.5}), 0.9, 2600.0, 0.6),
    backlash=Wear(MappingProxyType({"two-phase": 0.6, "power law": 0.4}), 0.8, 2800.0, 0.6),
    short_a=Wear(MappingProxyType({"sudden onset": 1.0}), 0.4, 3600.0, 0.4, 0.4),
    short_b=Wear(MappingProxyType({"gamma process": 1.0}), 0.5, 3200.0, 0.4),
    eccentricity=Wear(MappingProxyType({"logistic": 1.0}), 0.6, 3000.0, 0.5),
    gain=Wear(MappingProxyType({"linear": 1.0}), 0.3, 6000.0, 0.2),
)
"""The fleet of `emaphm fleet simulate` and of the study, defined before the filter was evaluated on it."""

DEVELOPMENT = _of(
    "development",
    friction=Wear(MappingProxyType({"power law": 0.6, "gamma process": 0.4}), 0.8, 3400.0, 0.5, 0.4),
    backlash=Wear(MappingProxyType({"exponential": 0.5, "logistic": 0.5}), 0.9, 2200.0, 0.7, 0.25),
    short_a=Wear(MappingProxyType({"linear": 1.0}), 0.5, 3800.0, 0.3, 0.4),
    short_c=Wear(MappingProxyType({"two-phase": 1.0}), 0.5, 3000.0, 0.5, 0.3),
    eccentricity=Wear(MappingProxyType({"sudden onset": 0.6, "linear": 0.4}), 0.6, 2600.0, 0.6, 0.35),
)
"""Another fleet, with other laws for each component, on which the prognosis was developed."""

POPULATIONS: Mapping[str, Population] = MappingProxyType({one.name: one for one in (FLEET, DEVELOPMENT)})
