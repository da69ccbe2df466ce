"""Margins of the requirements of a unit with given faults."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from emaphm.actuator import COMPONENTS, NAMES, Actuator
from emaphm.actuator.faults import HEALTHY, from_cartesian, lower_bounds, present_components
from emaphm.actuator.quantity import unit_for
from emaphm.actuator.requirements import MEASURE_UNITS, Requirement
from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.prognosis.requirements.capability import measured

FULL_SCALE = tuple(Requirement(component=name, at_most=1.0) for name in COMPONENTS if name != "gain")
"""Requirements of an actuator without stated ones: each of its levels is below the end of its scale."""


@dataclass(frozen=True)
class Limit:
    """One side of a requirement: its value is at most (`upper`) or at least `bound`.

    `label` is its name in results, unique for an actuator. `least` is the lower bound of the component's
    level.
    """

    requirement: Requirement
    bound: float
    upper: bool
    label: str
    unit: str
    least: float = 0.0

    @property
    def component(self) -> str | None:
        """The component whose level is limited, None if the limit is on a measure."""
        return self.requirement.component

    @property
    def holds_always(self) -> bool:
        """Whether no level violates it: it is below the least level, or at it where that is healthy."""
        if self.component is None or self.upper:
            return False
        healthy = HEALTHY.vector[NAMES.index(self.component)]
        return self.bound < self.least or bool(self.bound == self.least == healthy)

    def margin(self, value: Array) -> Array:
        """Return the margin of `value`, any shape, to the bound, in its unit; negative if violated."""
        return self.bound - value if self.upper else value - self.bound


@dataclass(frozen=True)
class Requirements:
    """Requirements of `actuator`, as limits."""

    actuator: Actuator

    @property
    def stated(self) -> bool:
        """Whether the actuator states requirements; otherwise they are `FULL_SCALE`."""
        return bool(self.actuator.requirements)

    @property
    def all(self) -> tuple[Requirement, ...]:
        """The requirements."""
        names = present_components(self.actuator)
        present = tuple(requirement for requirement in FULL_SCALE if requirement.component in names)
        return self.actuator.requirements or present or FULL_SCALE

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """The limits of all requirements, in their order."""
        limits: list[Limit] = []
        labels: list[str] = []
        lowest = lower_bounds(self.actuator)
        for requirement in self.all:
            unit = (
                unit_for(MEASURE_UNITS[requirement.measure], self.actuator.coordinates)
                if requirement.measure
                else "-"
            )
            for bound, upper in ((requirement.at_most, True), (requirement.at_least, False)):
                if bound is not None:
                    label = _label(requirement, bound, unit, upper=upper)
                    repetitions = labels.count(label)
                    labels.append(label)
                    name = f"{label} ({repetitions + 1})" if repetitions else label
                    least = lowest[NAMES.index(requirement.component)] if requirement.component else 0.0
                    limits.append(Limit(requirement, bound, upper, name, unit, float(least)))
        return tuple(limits)

    def values(self, vectors: Array, limits: Sequence[Limit] | None = None) -> Array:
        """Return the limited quantities (limits, n) for fault `vectors` (n, 8), in the units of the limits.

        `limits` are by default all limits.

        Raises
        ------
        MethodError
            The averaged model did not stay finite.
        """
        computed: dict[Requirement, Array] = {}
        rows = []
        for limit in self.limits if limits is None else limits:
            if limit.component is not None:
                rows.append(vectors[:, NAMES.index(limit.component)])
                continue
            run = limit.requirement.model_copy(update={"name": None, "at_most": None, "at_least": None})
            if run not in computed:
                computed[run] = measured(self.actuator, run, vectors)
            rows.append(computed[run])
        return np.stack(rows)

    def margins(self, vectors: Array, limits: Sequence[Limit] | None = None) -> Array:
        """Return the margins (limits, n) for fault `vectors` (n, 8); errors as in `values`."""
        selected = self.limits if limits is None else limits
        values = self.values(vectors, selected)
        return np.stack([limit.margin(row) for limit, row in zip(selected, values, strict=True)])

    def check_new(self) -> None:
        """Refuse a requirement that a new actuator violates: its life would be 0.

        Raises
        ------
        PrognosisError
            A new actuator violates a requirement.
        MethodError
            The averaged model did not stay finite.
        """
        values = self.values(HEALTHY.vector[np.newaxis])[:, 0]
        for limit, value in zip(self.limits, values, strict=True):
            if limit.margin(value) < 0:
                unit = "" if limit.unit == "-" else f" {limit.unit}"
                raise PrognosisError(
                    f"a new actuator of '{self.actuator.name}' violates the requirement '{limit.label}', it "
                    f"has {value:.4g}{unit}: correct the limit, or the description (emaphm limits)"
                )

    def can_fail(self, limit: Limit) -> bool:
        """Return whether a single fault at an end of its scale violates a limit; errors as in `values`."""
        columns = [NAMES.index(name) for name in present_components(self.actuator)]
        ends = np.tile(HEALTHY.vector, (2 * len(columns), 1))
        for i, column in enumerate(columns):
            ends[2 * i : 2 * i + 2, column] = lower_bounds(self.actuator)[column], 1.0
        return bool(np.any(self.margins(ends, [limit]) < 0))


def vectors_of(levels: Array, actuator: Actuator) -> Array:
    """Return the normalised fault vectors (…, 8) of levels (…, 8), clipped to their bounds.

    Levels have the coordinates `CARTESIAN_NAMES`, with the two components of the eccentricity. The bounds are
    those of `actuator`: [0, 1], except that friction may be below that of a new unit.
    """
    return np.clip(from_cartesian(levels), lower_bounds(actuator), 1.0)


def _label(requirement: Requirement, bound: float, unit: str, *, upper: bool) -> str:
    quantity = requirement.name or f"{requirement.component or requirement.measure}"
    return f"{quantity} {'at most' if upper else 'at least'} {bound:g}{'' if unit == '-' else f' {unit}'}"
