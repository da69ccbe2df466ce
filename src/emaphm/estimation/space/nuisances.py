"""Nuisances: unknown parameters that are no faults, their effects and their priors.

The coordinate of a nuisance is its value divided by `PRIORS_PER_UNIT` standard deviations of its prior
(`emaphm.actuator.nuisance_priors.Nuisances`), so that its size is similar to that of a fault. Some nuisances
belong to a recording, for example the load; others belong to the unit: deviations of its parameters from the
description.
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
"""Number of prior standard deviations per unit of a nuisance's coordinate."""

LEAST = 0.1
"""Lower limit of the factor that a nuisance may apply to a parameter, for any width of its prior."""

LOAD_VARIATION = "load_variation"
"""The nuisance that stands for several: the coefficients of a load that varies over the recording, or its
steps."""

HINGE = "hinge"
"""The nuisance of a load proportional to the position."""

KNOWN_BY = {
    "load": "load_Nm",
    HINGE: "load_Nm",
    LOAD_VARIATION: "load_Nm",
    "temperature": "temperature_K",
}
"""The channel that determines a nuisance if it was recorded."""

WIDEST = 4.0
"""Bound of a nuisance, in standard deviations of its prior."""

NEEDS_WINDINGS = ("temperature", "supply", *(f"voltage_{kind}" for kind in ERROR_KINDS))

USUAL_ZERO = 2e-3
"""Standard deviation of a sensor's zero, and of its drift, relative to its measuring range."""

BASELINE = "baseline "
"""Prefix of the name of a parameter's deviation from its described value."""

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
    """The value of a nuisance that was determined outside of the search, and its standard deviation."""

    value: float
    deviation: float


@dataclass(frozen=True, eq=False)
class NuisanceSet:
    """The nuisances that are estimated with the faults: coordinates with independent priors.

    `names`, `priors` (standard deviations) and `widest` (bounds), (m,) each, belong to the coordinates.
    `quantities` are the physical values, in their own units: the chosen nuisances, and the deviations of the
    unit's `parameters`. The matrix `meaning`, (quantities, m), converts coordinates to quantities. `located`
    are quantities whose values were determined otherwise: their coordinates are relative to these values.
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
        """Return the nuisances `names`, or those of the description, without those that `channels` determine.

        The set also contains the deviations of the `unit`; by default, those of the actuator's baseline and
        tolerances. `located` nuisances have their located values and standard deviations instead of the
        nominal values and priors. A load that varies has as many coefficients as a recording of `duration`
        [s] needs.

        Raises
        ------
        MethodError
            `names` is a string, a name is unknown, or it needs an electrical description, which the actuator
            does not have.
        """
        if isinstance(names, str):
            raise MethodError(f"nuisances are names in a sequence, not '{names}'; give ['{names}']")
        chosen = _expanded(actuator.nuisances.estimated if names is None else names, duration)
        for name in chosen:
            if described_name(name) not in NAMES or not _is_located(name, located or {}):
                raise MethodError(f"unknown nuisance '{name}'{nearest(name, NAMES)}")
            if names is not None and name in NEEDS_WINDINGS and actuator.electrical is None:
                raise MethodError(
                    f"nuisance '{name}' needs an [electrical] section, which actuator '{actuator.name}' lacks"
                )
        estimated = tuple(name for name in chosen if _is_unknown(actuator, name, channels))
        known = {name: value for name, value in (located or {}).items() if name in estimated}
        deviations = [
            known[name].deviation if name in known else usual_deviation(actuator, name) for name in estimated
        ]
        priors = np.full(len(estimated), 1 / PRIORS_PER_UNIT)
        meaning = np.diag([PRIORS_PER_UNIT * deviation for deviation in deviations])
        of_recording = cls(estimated, priors, WIDEST * priors, estimated, meaning, (), known)
        return of_recording.with_unit(unit or ParameterVariation.of_unit(actuator))

    def with_unit(self, unit: ParameterVariation) -> Self:
        """Return the same nuisances of the recording with other deviations of the `unit`."""
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
        """The estimated quantities of the recording, without those of the unit."""
        return tuple(name for name in self.quantities if not name.startswith(BASELINE))

    def others(self, actuator: Actuator, channels: Sequence[str]) -> tuple[str, ...]:
        """Return the nuisances that could also be estimated: not estimated, not known, with a known prior.

        A load proportional to the position is included only if the description states its prior: otherwise it
        is tried together with a load that varies.
        """
        return tuple(
            name
            for name in NAMES
            if name not in (*self.chosen, *self.parameters, LOAD_VARIATION)
            and _is_unknown(actuator, name, channels)
            and _is_observable(name, channels)
            and _prior(actuator, name) is not None
            and (name != HINGE or has_stated_prior(actuator, name))
        )

    @property
    def unit(self) -> ParameterVariation:
        """The possible deviations of the unit's parameters, as given to `of`."""
        first = len(self.chosen)
        return ParameterVariation(
            self.parameters, self.meaning[first:, first:], self.priors[first:], self.widest[first:]
        )

    @property
    def prior_deviations(self) -> Array:
        """The prior standard deviation of each quantity, in its own unit, (quantities,)."""
        return self.standard_errors(np.diag(self.priors**2))

    def standard_errors(self, covariance: Array) -> Array:
        """Return the standard error of each quantity, (quantities,), from the coordinates' covariance."""
        return np.asarray(np.sqrt(np.einsum("qi,ij,qj->q", self.meaning, covariance, self.meaning)))

    def values(self, points: Array) -> dict[str, Array]:
        """Return the values (n,) of each quantity, in its own unit, for `points` (n, m)."""
        # Summed row by row: the last bits of a matrix product would depend on the number of rows.
        values = np.sum(points[:, np.newaxis, :] * self.meaning, axis=2)
        result = dict(zip(self.quantities, values.T, strict=True))
        return result | {name: located.value + result[name] for name, located in self.located.items()}

    @property
    def nominal(self) -> Array:
        """The coordinates (m,) of the description: 0, except for located nuisances with a described value."""
        point = np.zeros(len(self.names))
        for name, located in self.located.items():
            if not is_of_step_time(name):
                i = self.names.index(name)
                point[i] = -located.value / self.meaning[i, i]
        return point

    def lumped_parameters(
        self, actuator: Actuator, values: Mapping[str, Array], temperature_rise_K: float = 0.0
    ) -> dict[str, Array]:
        """Return the lumped parameters for `values` (n,) of the quantities, shape (n,) each.

        The known `temperature_rise_K` above nominal is added to an estimated one. Nuisances of the recording
        act on the parameters of the unit including their deviations.
        """
        result = {name: varied(actuator, name, values[BASELINE + name]) for name in self.parameters}

        def of_unit(name: str) -> Array:
            return result[name] if name in result else np.asarray(lumped_parameters(actuator, (name,))[name])

        result |= {name: values[name] for name in values if name.startswith((PREFIX, STEP_PREFIX))}
        if "load" in values:
            result["offset"] = of_unit("offset") + values["load"]
        if "hinge" in values:
            result["hinge"] = of_unit("hinge") + values["hinge"]
        if "inertia" in values:
            result["inertia"] = of_unit("inertia") * np.maximum(1 + values["inertia"], LEAST)
        if "supply" in values:
            result["supply"] = of_unit("supply") * np.maximum(1 + values["supply"], LEAST)
        if "temperature" in values or temperature_rise_K:
            known = np.asarray(temperature_rise_K)
            if actuator.electrical is not None and actuator.electrical.temperature_gain is not None:
                known = of_unit("temperature_gain") * temperature_rise_K
            rise = np.asarray(values.get("temperature", 0.0)) + known
            if actuator.friction is not None and actuator.friction.viscous_temperature is not None:
                result["viscous"] = of_unit("viscous") * np.exp(-of_unit("viscous_temperature") * rise)
            result["resistance"] = of_unit("resistance") * np.maximum(1 + COPPER * rise, LEAST)
            result["torque_constant"] = of_unit("torque_constant") * np.maximum(1 + MAGNETS * rise, LEAST)
        return result


NO_NUISANCES = NuisanceSet((), np.zeros(0), np.zeros(0), (), np.zeros((0, 0)), ())
"""The empty set, for an estimation of the faults alone."""


def _expanded(names: Sequence[str], duration: float) -> tuple[str, ...]:
    """Return the names without repetition, a load that varies replaced by all of its coefficients."""
    coefficients = coefficient_names(coefficients_for(duration))
    of_spline = [name == LOAD_VARIATION or name.startswith(PREFIX) for name in names]
    groups = [coefficients if spline else (name,) for name, spline in zip(names, of_spline, strict=True)]
    return tuple(dict.fromkeys(name for group in groups for name in group))


def _is_of_load(name: str) -> bool:
    """Return whether a nuisance belongs to a load that varies."""
    return described_name(name) == LOAD_VARIATION


def described_name(name: str) -> str:
    """Return the described name of a nuisance: coefficients and steps of a load that varies have one name."""
    return LOAD_VARIATION if name.startswith((PREFIX, STEP_PREFIX)) else name


def is_of_step_time(name: str) -> bool:
    """Return whether a nuisance is the time or rise time of a load's step, which is always located."""
    return name.startswith(STEP_PREFIX) and name.endswith(STEP_PARTS[1:])


def _is_located(name: str, located: Mapping[str, Located]) -> bool:
    """Return whether a nuisance is no part of a load's step, or part of a step whose times are located."""
    number = name.removeprefix(STEP_PREFIX).partition("_")[0]
    times = (f"{STEP_PREFIX}{number}{part}" for part in STEP_PARTS[1:])
    return not name.startswith(STEP_PREFIX) or all(time in located for time in times)


def _is_unknown(actuator: Actuator, name: str, channels: Sequence[str]) -> bool:
    """Return whether a nuisance acts on a described part and `channels` do not determine it."""
    acts = name not in NEEDS_WINDINGS or actuator.electrical is not None
    if name == "supply" and makes_supply_known(channels, actuator):
        return False
    return acts and KNOWN_BY.get(described_name(name)) not in channels


def _is_observable(name: str, channels: Sequence[str]) -> bool:
    """Return whether `channels` contain a sensor's error; a single sensor has only the common delay."""
    error = sensor_error(name)
    if error is None:
        return True
    quantity, kind = error
    recorded = [
        measured for measured, names in SENSOR_CHANNELS.items() if any(name in channels for name in names)
    ]
    if quantity == "all":
        return bool(recorded)
    return quantity in recorded and (kind != "delay" or len(recorded) > 1)


def _prior(actuator: Actuator, name: str) -> float | None:
    """Return the prior standard deviation of a nuisance, in its own unit, None if it is not known."""
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
    """Return whether `name` is a nuisance whose prior is stated in the description, not a default."""
    return described_name(name) in NAMES and getattr(actuator.nuisances, described_name(name)) is not None


def _range(actuator: Actuator, quantity: str) -> float | None:
    """Return the largest magnitude of a quantity according to the actuator's limits, None without a limit."""
    controller, stops, electrical = actuator.controller, actuator.mechanics.end_stops, actuator.electrical
    return {
        "current": controller.current_limit,
        "voltage": None if electrical is None else electrical.supply,
        "position": None if stops is None else max(map(abs, stops)),
        "speed": controller.speed_limit,
    }[quantity]


def with_wider_priors(actuator: Actuator, factors: Mapping[str, float]) -> Actuator:
    """Return the actuator with the priors of nuisances multiplied by `factors`, by name."""
    priors = {
        described_name(name): factor * usual_deviation(actuator, name) for name, factor in factors.items()
    }
    return actuator.model_copy(update={"nuisances": actuator.nuisances.model_copy(update=priors)})


def usual_deviation(actuator: Actuator, name: str) -> float:
    """Return the prior standard deviation of a nuisance, in its own unit.

    Raises
    ------
    MethodError
        The description neither states nor implies it.
    """
    prior = _prior(actuator, name)
    if prior is None:
        raise MethodError(
            f"the size of nuisance '{name}' is not known; give its standard deviation as {name} in "
            f"[nuisances] of actuator '{actuator.name}'"
        )
    return prior
