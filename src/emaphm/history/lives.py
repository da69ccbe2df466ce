"""Lives of units and of their components, ended by failure or censored."""

from collections.abc import Iterable
from dataclasses import dataclass

from emaphm.history.records import UNIT, Finding, Removal


@dataclass(frozen=True)
class Life:
    """A life from `start_hours` to `end_hours` [h], ended by failure, or censored."""

    start_hours: float
    end_hours: float
    failed: bool

    @property
    def censored(self) -> bool:
        """Whether the life went on, or was ended by something else than failure."""
        return not self.failed


def lives_of_unit(hours: float, removals: Iterable[Removal], findings: Iterable[Finding]) -> tuple[Life, ...]:
    """Return the lives of a unit between its removals, the last up to its latest `hours` [h].

    A removal ended a life by failure if the shop found so; where no shop has reported (no finding of the
    same hours), if that was its reason.
    """
    found: dict[float, list[bool]] = {}
    for one in findings:
        found.setdefault(one.hours, []).append(one.condition == "failed")
    ends = [(one.hours, any(found.get(one.hours, [one.reason == "failed"]))) for one in removals]
    return _lives(hours, ends)


def lives_of_component(hours: float, component: str, findings: Iterable[Finding]) -> tuple[Life, ...]:
    """Return the lives of a component: each ended when it was replaced, or found failed."""
    ends: dict[float, bool] = {}
    for one in findings:
        if one.component in (component, UNIT):
            own_failure = one.component == component and one.condition == "failed"
            if one.replaced or own_failure:
                ends[one.hours] = ends.get(one.hours, False) or own_failure
    return _lives(hours, list(ends.items()))


def _lives(hours: float, ends: list[tuple[float, bool]]) -> tuple[Life, ...]:
    result, start = [], 0.0
    for end, failed in sorted(ends):
        result.append(Life(start, end, failed))
        start = end
    if hours > start:
        result.append(Life(start, hours, failed=False))
    return tuple(result)
