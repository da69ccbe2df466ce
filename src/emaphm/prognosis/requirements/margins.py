"""Requirements as margins: how far a unit with given faults is from failing each."""

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
"""Requirements of an actuator that states none: each level that it may have is below the end of its scale."""


@dataclass(frozen=True)
class Limit:
    """One side of a requirement: its value is at most (`upper`) or at least `bound`.

    `label` is its name in results, unique among those of an actuator. `least` is the least level that the
    component of the actuator can have.
    """

    requirement: Requirement
    bound: float
    upper: bool
    label: str
    unit: str
    least: float = 0.0

    @property
    def component(self) -> str | None:
        """The component whose level it limits, None where it limits a measure."""
        return self.requirement.component

    @property
    def holds_always(self) -> bool:
        """Whether no level is beyond it: below the least one, or 0 of a component that is healthy at 0."""
        if self.component is None or self.upper:
            return False
        return self.bound < self.least or bool(self.bound == HEALTHY.vector[NAMES.index(self.component)] == 0)

    def margin(self, value: Array) -> Array:
        """Return how far `value`, any shape, is from the bound, in its unit; negative beyond it."""
        return self.bound - value if self.upper else value - self.bound


@dataclass(frozen=True)
class Requirements:
    """What `actuator` must do, as its limits."""

    actuator: Actuator

    @property
    def stated(self) -> bool:
        """Whether the actuator states requirements; else they are `FULL_SCALE`."""
        return bool(self.actuator.requirements)

    @property
    def all(self) -> tuple[Requirement, ...]:
        """The requirements."""
        names = present_components(self.actuator)
        present = tuple(one for one in FULL_SCALE if one.component in names)
        return self.actuator.requirements or present or FULL_SCALE

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """The limits of all requirements, in their order."""
        found: list[Limit] = []
        labels: list[str] = []
        lowest = lower_bounds(self.actuator)
        for one in self.all:
            unit = unit_for(MEASURE_UNITS[one.measure], self.actuator.coordinates) if one.measure else "-"
            for bound, upper in ((one.at_most, True), (one.at_least, False)):
                if bound is not None:
                    label = _label(one, bound, unit, upper=upper)
                    again = labels.count(label)
                    labels.append(label)
                    name = f"{label} ({again + 1})" if again else label
                    least = lowest[NAMES.index(one.component)] if one.component else 0.0
                    found.append(Limit(one, bound, upper, name, unit, float(least)))
        return tuple(found)

    def values(self, vectors: Array, limits: Sequence[Limit] | None = None) -> Array:
        """Return what each of the limits, all where left out, is on, of the fault `vectors` (n, 8).

        Shape (limits, n), each in its unit.

        Raises
        ------
        MethodError
            The averaged model did not stay finite.
        """
        known: dict[Requirement, Array] = {}
        rows = []
        for limit in self.limits if limits is None else limits:
            if limit.component is not None:
                rows.append(vectors[:, NAMES.index(limit.component)])
                continue
            run = limit.requirement.model_copy(update={"name": None, "at_most": None, "at_least": None})
            if run not in known:
                known[run] = measured(self.actuator, run, vectors)
            rows.append(known[run])
        return np.stack(rows)

    def margins(self, vectors: Array, limits: Sequence[Limit] | None = None) -> Array:
        """Return the margins of the fault `vectors` (n, 8): (limits, n); errors as in `values`."""
        chosen = self.limits if limits is None else limits
        values = self.values(vectors, chosen)
        return np.stack([one.margin(row) for one, row in zip(chosen, values, strict=True)])

    def check_new(self) -> None:
        """Refuse a requirement that a new actuator violates: its life would begin with its end.

        Raises
        ------
        PrognosisError
            There is one.
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
        """Return whether any single fault at an end of its scale violates a limit; errors as in `values`."""
        columns = [NAMES.index(name) for name in present_components(self.actuator)]
        ends = np.tile(HEALTHY.vector, (2 * len(columns), 1))
        for i, column in enumerate(columns):
            ends[2 * i : 2 * i + 2, column] = lower_bounds(self.actuator)[column], 1.0
        return bool(np.any(self.margins(ends, [limit]) < 0))


def vectors_of(levels: Array, actuator: Actuator) -> Array:
    """Return the normalised fault vectors (…, 8) of levels (…, 8), put within their bounds.

    Levels are in the coordinates `CARTESIAN_NAMES`, eccentricity by its two components. The bounds are those
    of `actuator`: [0, 1], but for a friction below that of a new unit.
    """
    return np.clip(from_cartesian(levels), lower_bounds(actuator), 1.0)


def _label(one: Requirement, bound: float, unit: str, *, upper: bool) -> str:
    what = one.name or f"{one.component or one.measure}"
    return f"{what} {'at most' if upper else 'at least'} {bound:g}{'' if unit == '-' else f' {unit}'}"
