"""Populations of synthetic fleets: components that wear, their laws and lives, stress and rig."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType


@dataclass(frozen=True)
class Wear:
    """Degradation of one component over the units of a fleet.

    Parameters
    ----------
    laws
        Names of `growth.LAWS` with their shares of the units.
    share
        Share of the units in which it degrades.
    life
        Median over the units of the hours to its limit under nominal stress [h].
    spread
        Standard deviation of the logarithm of these hours over the units.
    limit
        Distance from the healthy level at which it fails.
    """

    laws: Mapping[str, float]
    share: float
    life: float
    limit: float
    spread: float = 0.3


@dataclass(frozen=True)
class StressModel:
    """Stress of the units; a unit ages faster than nominal by the factor 2^(ΔT/d) (1 + l)^3.

    ΔT [K] is the deviation of the ambient temperature from nominal; ageing doubles with each `doubling` d [K]
    (Arrhenius law over a narrow range). l is the relative deviation of the load, cubed as in the life of
    bearings (ISO 281). Both are sums of a value of the unit's mission and one of each flight, with the
    standard deviations below.
    """

    doubling: float = 40.0
    mission_K: float = 8.0
    flight_K: float = 10.0
    mission_load: float = 0.06
    flight_load: float = 0.06


@dataclass(frozen=True)
class CheckFlightRig:
    """Recording of a check flight, and its unknown conditions; all values are chosen.

    The command is a chirp of `amplitude` [rad] up to `stop_hz` [Hz] for `duration` [s]. Current and line
    voltage are recorded, with white `noise` on the current [A rms] and converters of `adc_bits`. Unknown are
    a constant load within ± `load` [N·m], windings within ± `heat` [K] of the ambient temperature, and a
    supply within ± `supply` of nominal, relative.
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
    """Population of a fleet: the wear of each component, the stress and the rig.

    `drift` is the standard deviation of a level from its law over a life, by a Wiener process; `new_level` is
    that of a new component's level about the healthy level.
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
"""Population of `emaphm fleet simulate` and of the study. It was chosen before the filter was tested on
it."""

DEVELOPMENT = _of(
    "development",
    friction=Wear(MappingProxyType({"power law": 0.6, "gamma process": 0.4}), 0.8, 3400.0, 0.5, 0.4),
    backlash=Wear(MappingProxyType({"exponential": 0.5, "logistic": 0.5}), 0.9, 2200.0, 0.7, 0.25),
    short_a=Wear(MappingProxyType({"linear": 1.0}), 0.5, 3800.0, 0.3, 0.4),
    short_c=Wear(MappingProxyType({"two-phase": 1.0}), 0.5, 3000.0, 0.5, 0.3),
    eccentricity=Wear(MappingProxyType({"sudden onset": 0.6, "linear": 0.4}), 0.6, 2600.0, 0.6, 0.35),
)
"""Population for the development of the prognosis, with other laws for each component."""

POPULATIONS: Mapping[str, Population] = MappingProxyType(
    {population.name: population for population in (FLEET, DEVELOPMENT)}
)
