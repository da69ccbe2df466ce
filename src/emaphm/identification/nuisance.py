"""What is not known of a recording and is no fault: how each nuisance acts, and what is known of it before.

A nuisance's coordinate is its value in `RANGE` standard deviations of its prior
(`emaphm.actuator.parameters.Nuisances`), so that it is of the size of a fault's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.actuator.parameters import Nuisances
from emaphm.actuator.totals import totals
from emaphm.errors import MethodError, nearest

Array = NDArray[np.float64]

COPPER = 3.93e-3
"""Temperature coefficient of the resistance of copper at 20 °C [1/K] (IEC 60028)."""

MAGNETS = -1.1e-3
"""Temperature coefficient of the remanence of NdFeB magnets, and so of the torque constant [1/K]."""

RANGE = 5.0
"""Standard deviations of the prior to a unit of a nuisance's coordinate."""

LEAST = 0.1
"""Share of a total that a nuisance leaves of it at least, however wide its prior."""

KNOWN_BY = {"load": "load_Nm", "hinge": "load_Nm", "temperature": "temperature_K"}
"""The channel that makes a nuisance known where it was recorded."""

NEEDS_WINDINGS = ("temperature", "supply")

NAMES = tuple(name for name in Nuisances.model_fields if name != "estimated")


def unit_of(name: str) -> str:
    """Return the unit of a nuisance, for a rotary actuator."""
    extra = Nuisances.model_fields[name].json_schema_extra
    return str(extra["unit"]) if isinstance(extra, dict) else "-"


@dataclass(frozen=True)
class NuisanceSet:
    """The nuisances that are estimated: `names`, and the prior standard deviation of each, (m,)."""

    names: tuple[str, ...]
    deviations: Array

    @classmethod
    def of(cls, actuator: Actuator, names: Sequence[str] | None, channels: Sequence[str]) -> Self:
        """Return the named nuisances, or the actuator's own, less what `channels` make known.

        Raises
        ------
        MethodError
            A name is unknown, or needs the electrical description that the actuator lacks.
        """
        chosen = tuple(dict.fromkeys(actuator.nuisances.estimated if names is None else names))
        for name in chosen:
            if name not in NAMES:
                raise MethodError(f"unknown nuisance '{name}'{nearest(name, NAMES)}")
            if names is not None and name in NEEDS_WINDINGS and actuator.electrical is None:
                raise MethodError(
                    f"nuisance '{name}' needs an [electrical] section, which actuator '{actuator.name}' lacks"
                )
        kept = tuple(
            name
            for name in chosen
            if KNOWN_BY.get(name) not in channels
            and not (name in NEEDS_WINDINGS and actuator.electrical is None)
        )
        return cls(kept, np.array([_deviation(actuator, name) for name in kept]))

    def values(self, points: Array) -> dict[str, Array]:
        """Return each nuisance's values (n,) in its own unit for `points` (n, m)."""
        return dict(zip(self.names, (points * RANGE * self.deviations).T, strict=True))

    def totals(
        self, actuator: Actuator, values: Mapping[str, Array], warmer: float = 0.0
    ) -> dict[str, Array]:
        """Return the physical totals under nuisance `values` (n,) each, `warmer` K being known besides."""
        result: dict[str, Array] = {}

        def present(name: str) -> float:
            return totals(actuator, (name,))[name]

        if "load" in values:
            result["offset"] = present("offset") + values["load"]
        if "hinge" in values:
            result["hinge"] = present("hinge") + values["hinge"]
        if "inertia" in values:
            result["inertia"] = present("inertia") * np.maximum(1 + values["inertia"], LEAST)
        if "supply" in values:
            result["supply"] = present("supply") * np.maximum(1 + values["supply"], LEAST)
        if "temperature" in values or warmer:
            above = np.asarray(values.get("temperature", 0.0)) + warmer
            result["resistance"] = present("resistance") * np.maximum(1 + COPPER * above, LEAST)
            result["torque_constant"] = present("torque_constant") * np.maximum(1 + MAGNETS * above, LEAST)
        return result


def _deviation(actuator: Actuator, name: str) -> float:
    """Return the prior standard deviation of a nuisance, in its own unit."""
    given = getattr(actuator.nuisances, name)
    limit = actuator.controller.current_limit
    if given is None:
        given = {"load": 0.06 * limit * actuator.motor.torque_constant, "current_offset": 2e-3 * limit}.get(
            name
        )
    if given is None:
        raise MethodError(
            f"how large nuisance '{name}' may be is not known; give its standard deviation as {name} in "
            f"[nuisances] of actuator '{actuator.name}'"
        )
    return float(given)
