"""Nuisances: unknown parameters that are no faults, how each acts, and its prior.

A nuisance's coordinate is its value in `PRIORS_PER_UNIT` standard deviations of its prior
(`emaphm.actuator.nuisance_priors.Nuisances`), so that it is of the size of a fault's. Some belong to one
recording, such as the load; others to the unit: how its parameters deviate from its description.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.lumped_parameters import lumped_parameters
from emaphm.actuator.nuisance_priors import Nuisances
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.errors import MethodError, nearest
from emaphm.estimation.recorded_supply import makes_supply_known
from emaphm.estimation.sensors.sensor_model import ERROR_KINDS, SENSOR_CHANNELS, sensor_error
from emaphm.estimation.space.parameter_variation import ParameterVariation, variation_unit, varied
from emaphm.simulation.laws.load_steps import STEP_PARTS, STEP_PREFIX
from emaphm.simulation.laws.load_variation import PREFIX, coefficient_names, coefficients_for

COPPER = 3.93e-3
"""Temperature coefficient of the resistance of copper at 20 °C [1/K] (IEC 60028)."""

MAGNETS = -1.1e-3
"""Temperature coefficient of the remanence of NdFeB magnets, and so of the torque constant [1/K]."""

MAGNETS_DEVIATION = 0.2
"""Standard deviation of that coefficient, relative: grades of NdFeB have -0.09 to -0.13 %/K."""

PRIORS_PER_UNIT = 5.0
"""Standard deviations of the prior to a unit of a nuisance's coordinate."""

LEAST = 0.1
"""Share of a total that a nuisance leaves of it at least, however wide its prior."""

LOAD_VARIATION = "load_variation"
"""The nuisance that stands for several: the coefficients of a load over the recording, or steps of it."""

HINGE = "hinge"
"""The nuisance that is a load which rises with the position."""

KNOWN_BY = {
    "load": "load_Nm",
    HINGE: "load_Nm",
    LOAD_VARIATION: "load_Nm",
    "temperature": "temperature_K",
}
"""The channel that makes a nuisance known where it was recorded."""

WIDEST = 4.0
"""Bound of a nuisance, in standard deviations of its prior."""

NEEDS_WINDINGS = ("temperature", "supply", *(f"voltage_{kind}" for kind in ERROR_KINDS))

USUAL_ZERO = 2e-3
"""Standard deviation of a sensor's zero, and of its drift, relative to the range that it measures."""

BASELINE = "baseline "
"""What the name of a parameter's deviation from its described value begins with."""

NAMES = tuple(name for name in Nuisances.model_fields if name != "estimated")


def unit_of(name: str, coordinates: str = "rotary") -> str:
    """Return the unit of a nuisance, or of a deviation from the baseline."""
    if name.startswith(BASELINE):
        return variation_unit(name.removeprefix(BASELINE), coordinates)
    if is_of_step_time(name):
        return "s"
    extra = Nuisances.model_fields[described_name(name)].json_schema_extra
    return unit_for(str(extra["unit"]) if isinstance(extra, dict) else "-", coordinates)


@dataclass(frozen=True)
class Located:
    """The value of a nuisance as something other than the search has found it, and its standard deviation."""

    value: float
    deviation: float


@dataclass(frozen=True, eq=False)
class NuisanceSet:
    """The nuisances that are estimated with the faults: coordinates with independent priors.

    `names`, `priors` (standard deviations) and `widest` (bounds), (m,) each, are the coordinates'.
    `quantities` are what these stand for, in their own units: the chosen nuisances, and the deviations of
    the unit's `parameters`; `meaning`, (quantities, m), is what a unit of each coordinate adds to each.
    `located` are quantities whose values were found otherwise: their coordinates are about these.
    """

    names: tuple[str, ...]
    priors: Array
    widest: Array
    quantities: tuple[str, ...]
    meaning: Array
    parameters: tuple[str, ...]
    located: Mapping[str, Located] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        actuator: Actuator,
        names: Sequence[str] | None,
        channels: Sequence[str],
        unit: ParameterVariation | None = None,
        located: Mapping[str, Located] | None = None,
        *,
        duration: float = 0.0,
    ) -> Self:
        """Return the named nuisances, or the actuator's own, less what `channels` make known.

        And the deviations of the `unit`: as the actuator's baseline and tolerances have them where left out.
        Those that are `located` have their values and deviations in place of nominal and prior. A load that
        varies has as many coefficients as a recording of `duration` [s] needs.

        Raises
        ------
        MethodError
            They are one text, a name is unknown, or needs the electrical description that the actuator lacks.
        """
        if isinstance(names, str):
            raise MethodError(f"nuisances are names in a sequence, not '{names}'; give ['{names}']")
        chosen = _each(actuator.nuisances.estimated if names is None else names, duration)
        for name in chosen:
            if described_name(name) not in NAMES or not _is_located(name, located or {}):
                raise MethodError(f"unknown nuisance '{name}'{nearest(name, NAMES)}")
            if names is not None and name in NEEDS_WINDINGS and actuator.electrical is None:
                raise MethodError(
                    f"nuisance '{name}' needs an [electrical] section, which actuator '{actuator.name}' lacks"
                )
        kept = tuple(name for name in chosen if _matters(actuator, name, channels))
        known = {name: one for name, one in (located or {}).items() if name in kept}
        deviations = [
            known[name].deviation if name in known else usual_deviation(actuator, name) for name in kept
        ]
        priors = np.full(len(kept), 1 / PRIORS_PER_UNIT)
        meaning = np.diag([PRIORS_PER_UNIT * one for one in deviations])
        alone = cls(kept, priors, WIDEST * priors, kept, meaning, (), known)
        return alone.with_unit(unit or ParameterVariation.of_unit(actuator))

    def with_unit(self, unit: ParameterVariation) -> Self:
        """Return the same chosen nuisances with other deviations of the unit."""
        chosen, count = self.chosen, len(self.chosen)
        axes = tuple(BASELINE + name for name in unit.coordinates)
        meaning = np.zeros((count + len(unit.parameters), count + len(axes)))
        meaning[:count, :count] = self.meaning[:count, :count]
        meaning[count:, count:] = unit.axes
        return replace(
            self,
            names=(*chosen, *axes),
            priors=np.concatenate([self.priors[:count], unit.priors]),
            widest=np.concatenate([self.widest[:count], unit.widest]),
            quantities=(*chosen, *(BASELINE + name for name in unit.parameters)),
            meaning=meaning,
            parameters=unit.parameters,
        )

    @property
    def chosen(self) -> tuple[str, ...]:
        """What is estimated of the recording, less what is estimated of the unit."""
        return tuple(name for name in self.quantities if not name.startswith(BASELINE))

    def others(self, actuator: Actuator, channels: Sequence[str]) -> tuple[str, ...]:
        """Return what might be estimated too: neither estimated nor known, of a size that is known.

        A load that rises with the position only where the description states how much: it is tried as a load
        that varies is.
        """
        return tuple(
            name
            for name in NAMES
            if name not in (*self.chosen, *self.parameters, LOAD_VARIATION)
            and _matters(actuator, name, channels)
            and _shows(name, channels)
            and _prior(actuator, name) is not None
            and (name != HINGE or has_stated_prior(actuator, name))
        )

    @property
    def unit(self) -> ParameterVariation:
        """How the unit's parameters may deviate, as given to `of`."""
        first = len(self.chosen)
        return ParameterVariation(
            self.parameters, self.meaning[first:, first:], self.priors[first:], self.widest[first:]
        )

    @property
    def prior_deviations(self) -> Array:
        """The standard deviation of each quantity before the data, in its own unit, (quantities,)."""
        return self.standard_errors(np.diag(self.priors**2))

    def standard_errors(self, covariance: Array) -> Array:
        """Return the standard error of each quantity, (quantities,), from the `covariance` (m, m)."""
        return np.asarray(np.sqrt(np.einsum("qi,ij,qj->q", self.meaning, covariance, self.meaning)))

    def values(self, points: Array) -> dict[str, Array]:
        """Return the values (n,) of each quantity, in its own unit, for `points` (n, m)."""
        # Summed row by row: a matrix product's last bits would depend on how many rows there are.
        values = np.sum(points[:, np.newaxis, :] * self.meaning, axis=2)
        result = dict(zip(self.quantities, values.T, strict=True))
        return result | {name: one.value + result[name] for name, one in self.located.items()}

    @property
    def nominal(self) -> Array:
        """The coordinates (m,) of what is described: 0, but of what is located and might be as described."""
        point = np.zeros(len(self.names))
        for name, one in self.located.items():
            if not is_of_step_time(name):
                i = self.names.index(name)
                point[i] = -one.value / self.meaning[i, i]
        return point

    def lumped_parameters(
        self, actuator: Actuator, values: Mapping[str, Array], temperature_rise_K: float = 0.0
    ) -> dict[str, Array]:
        """Return the lumped parameters under `values` (n,) of the quantities, shape (n,) each.

        `temperature_rise_K` above nominal is known and adds to an estimated one.

        What a recording adds or multiplies, it does to the parameters of the unit as they deviate.
        """
        result = {name: varied(actuator, name, values[BASELINE + name]) for name in self.parameters}

        def present(name: str) -> Array:
            return result[name] if name in result else np.asarray(lumped_parameters(actuator, (name,))[name])

        result |= {name: values[name] for name in values if name.startswith((PREFIX, STEP_PREFIX))}
        if "load" in values:
            result["offset"] = present("offset") + values["load"]
        if "hinge" in values:
            result["hinge"] = present("hinge") + values["hinge"]
        if "inertia" in values:
            result["inertia"] = present("inertia") * np.maximum(1 + values["inertia"], LEAST)
        if "supply" in values:
            result["supply"] = present("supply") * np.maximum(1 + values["supply"], LEAST)
        if "temperature" in values or temperature_rise_K:
            known = np.asarray(temperature_rise_K)
            if actuator.electrical is not None and actuator.electrical.temperature_gain is not None:
                known = present("temperature_gain") * temperature_rise_K
            above = np.asarray(values.get("temperature", 0.0)) + known
            if actuator.friction is not None and actuator.friction.viscous_temperature is not None:
                result["viscous"] = present("viscous") * np.exp(-present("viscous_temperature") * above)
            result["resistance"] = present("resistance") * np.maximum(1 + COPPER * above, LEAST)
            result["torque_constant"] = present("torque_constant") * np.maximum(1 + MAGNETS * above, LEAST)
        return result


NO_NUISANCES = NuisanceSet((), np.zeros(0), np.zeros(0), (), np.zeros((0, 0)), ())
"""The faults alone are estimated."""


def _each(names: Sequence[str], duration: float) -> tuple[str, ...]:
    """Return the names, each once; all coefficients of a load that varies by its name or one of theirs."""
    coefficients = coefficient_names(coefficients_for(duration))
    of_spline = [name == LOAD_VARIATION or name.startswith(PREFIX) for name in names]
    each = [coefficients if spline else (name,) for name, spline in zip(names, of_spline, strict=True)]
    return tuple(dict.fromkeys(own for some in each for own in some))


def _is_of_load(name: str) -> bool:
    return described_name(name) == LOAD_VARIATION


def described_name(name: str) -> str:
    """Return what the description calls a nuisance: coefficients and steps of a load that varies are one."""
    return LOAD_VARIATION if name.startswith((PREFIX, STEP_PREFIX)) else name


def is_of_step_time(name: str) -> bool:
    """Return whether a nuisance is the time or rise time of a load's step, which is always located."""
    return name.startswith(STEP_PREFIX) and name.endswith(STEP_PARTS[1:])


def _is_located(name: str, located: Mapping[str, Located]) -> bool:
    """Return whether a nuisance is no part of a load's step, or of one whose times are located."""
    number = name.removeprefix(STEP_PREFIX).partition("_")[0]
    times = (f"{STEP_PREFIX}{number}{part}" for part in STEP_PARTS[1:])
    return not name.startswith(STEP_PREFIX) or all(time in located for time in times)


def _matters(actuator: Actuator, name: str, channels: Sequence[str]) -> bool:
    """Return whether a nuisance is not made known by `channels`, and acts on what the actuator has."""
    acts = name not in NEEDS_WINDINGS or actuator.electrical is not None
    if name == "supply" and makes_supply_known(channels, actuator):
        return False
    return acts and KNOWN_BY.get(described_name(name)) not in channels


def _shows(name: str, channels: Sequence[str]) -> bool:
    """Return whether a sensor's error shows in `channels`; the delay of the only one is that of all."""
    error = sensor_error(name)
    if error is None:
        return True
    quantity, kind = error
    shown = [one for one, names in SENSOR_CHANNELS.items() if any(name in channels for name in names)]
    if quantity == "all":
        return bool(shown)
    return quantity in shown and (kind != "delay" or len(shown) > 1)


def _prior(actuator: Actuator, name: str) -> float | None:
    """Return the prior standard deviation of a nuisance, in its own unit, where one is known."""
    given = getattr(actuator.nuisances, described_name(name))
    if given is not None:
        return float(given)
    limit = actuator.controller.current_limit
    if name == "load" or _is_of_load(name):
        return 0.06 * limit * actuator.motor.torque_constant
    error = sensor_error(name)
    if name == HINGE:
        travel = _range(actuator, "position")
        return None if travel is None else limit * actuator.motor.torque_constant / travel
    reach = None if error is None else _range(actuator, error[0])
    return None if reach is None else USUAL_ZERO * reach


def has_stated_prior(actuator: Actuator, name: str) -> bool:
    """Return whether `name` is a nuisance whose prior the description states, and does not leave as usual."""
    return described_name(name) in NAMES and getattr(actuator.nuisances, described_name(name)) is not None


def _range(actuator: Actuator, quantity: str) -> float | None:
    """Return the largest magnitude of a quantity that the actuator's limits imply, None without one."""
    controller, stops, electrical = actuator.controller, actuator.mechanics.end_stops, actuator.electrical
    return {
        "current": controller.current_limit,
        "voltage": None if electrical is None else electrical.supply,
        "position": None if stops is None else max(map(abs, stops)),
        "speed": controller.speed_limit,
    }[quantity]


def with_wider_priors(actuator: Actuator, factors: Mapping[str, float]) -> Actuator:
    """Return the actuator with priors of nuisances wider by `factors`, by name."""
    priors = {
        described_name(name): factor * usual_deviation(actuator, name) for name, factor in factors.items()
    }
    return actuator.model_copy(update={"nuisances": actuator.nuisances.model_copy(update=priors)})


def usual_deviation(actuator: Actuator, name: str) -> float:
    """Return the prior standard deviation of a nuisance, in its own unit."""
    prior = _prior(actuator, name)
    if prior is None:
        raise MethodError(
            f"how large nuisance '{name}' may be is not known; give its standard deviation as {name} in "
            f"[nuisances] of actuator '{actuator.name}'"
        )
    return prior
