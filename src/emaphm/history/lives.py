"""Lives of units and of their components, ended by failure or censored."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from emaphm.history.records import UNIT, Finding, Flight, Removal


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

    def to_dict(self) -> dict[str, Any]:
        """Return the life, ready for `json.dumps`."""
        return asdict(self) | {"censored": self.censored}


def latest_hours(
    flights: Sequence[Flight], removals: Sequence[Removal], findings: Sequence[Finding]
) -> float:
    """Return the hours of a unit [h]: those of its latest entry, be it a flight, a removal or a finding."""
    return max((one.hours for entries in (flights, removals, findings) for one in entries), default=0.0)


@dataclass(frozen=True)
class Failure:
    """A unit failed at `hours` [h]; `components` are those that a shop found failed then, if any."""

    hours: float
    components: tuple[str, ...]


def lives(
    flights: Sequence[Flight],
    removals: Sequence[Removal],
    findings: Sequence[Finding],
    component: str | None = None,
) -> tuple[Life, ...]:
    """Return the lives of a unit between its removals, or of a component between its replacements.

    A removal ended a life of the unit by failure if the shop found so; where no shop has reported (no finding
    of the same hours), if that was its reason. A component's life ends when it is found failed, or replaced;
    the next begins with a replacement. The last one goes up to the unit's latest hours, and is censored.
    """
    hours = latest_hours(flights, removals, findings)
    is_unit = component in (None, UNIT)
    ends = _removed(removals, findings) if is_unit else _found(str(component), findings)
    result: list[Life] = []
    start: float | None = 0.0
    for end in ends:
        if start is not None:
            result.append(Life(start, end.hours, end.failed))
        start = end.hours if end.renewed else None
    if start is not None and hours > start:
        result.append(Life(start, hours, failed=False))
    return tuple(result)


def unrepaired(
    flights: Sequence[Flight], removals: Sequence[Removal], findings: Sequence[Finding]
) -> Failure | None:
    """Return the failure that a unit has not been repaired of; None where it is in service, or may be again.

    It failed if a removal ended its life by failure, as in `lives`, or a shop found a component failed. A
    replacement at these hours or later puts it in service again, and so does a flight or a removal later on.
    """
    found = [one for one in findings if one.condition == "failed"]
    ends = [one.hours for one in _removed(removals, findings) if one.failed]
    hours = max((*ends, *(one.hours for one in found)), default=None)
    if hours is None or any(one.replaced and one.hours >= hours for one in findings):
        return None
    if max((*(one.hours for one in flights), *(one.hours for one in removals)), default=0.0) > hours:
        return None
    components = {one.component for one in found if one.hours == hours} - {UNIT}
    return Failure(hours, tuple(sorted(components)))


@dataclass(frozen=True)
class OpenRemoval:
    """A unit was removed as failed at `hours` [h]; a shop has `named` components then, none as failed."""

    hours: float
    named: tuple[str, ...]


def not_replaced(findings: Sequence[Finding]) -> tuple[Failure, ...]:
    """Return the failures of components of which no replacement is known, by hours, whatever came since."""
    renewed = [(one.component, one.hours) for one in findings if one.replaced]
    failed: dict[float, set[str]] = {}
    for one in findings:
        known = any(what in (one.component, UNIT) and hours >= one.hours for what, hours in renewed)
        if one.condition == "failed" and one.component != UNIT and not known:
            failed.setdefault(one.hours, set()).add(one.component)
    return tuple(Failure(hours, tuple(sorted(failed[hours]))) for hours in sorted(failed))


def open_removal(
    flights: Sequence[Flight], removals: Sequence[Removal], findings: Sequence[Finding]
) -> OpenRemoval | None:
    """Return the removal as failed of which a shop has only named components that are not; None without one.

    A finding on the unit as a whole closes it; so does a replacement at these hours or later, a flight, or
    another removal.
    """
    last = max(removals, key=lambda one: one.hours, default=None)
    if last is None or last.reason != "failed" or any(one.hours > last.hours for one in flights):
        return None
    found = [one for one in findings if one.hours == last.hours]
    is_closed = any(one.component == UNIT or one.condition == "failed" for one in found)
    if not found or is_closed or any(one.replaced and one.hours >= last.hours for one in findings):
        return None
    return OpenRemoval(last.hours, tuple(sorted(one.component for one in found)))


@dataclass(frozen=True)
class _End:
    """Of a life at `hours` [h]; another begins there if the component was `renewed`."""

    hours: float
    failed: bool
    renewed: bool


def _removed(removals: Sequence[Removal], findings: Sequence[Finding]) -> list[_End]:
    found: dict[float, list[bool]] = {}
    for one in findings:
        found.setdefault(one.hours, []).append(one.condition == "failed")
    return [
        _End(one.hours, any(found.get(one.hours, [one.reason == "failed"])), renewed=True) for one in removals
    ]


def _found(component: str, findings: Sequence[Finding]) -> list[_End]:
    ends: dict[float, _End] = {}
    for one in findings:
        failed = one.component == component and one.condition == "failed"
        renewed = one.replaced and one.component in (component, UNIT)
        if failed or renewed:
            before = ends.get(one.hours, _End(one.hours, failed=False, renewed=False))
            ends[one.hours] = _End(one.hours, before.failed or failed, before.renewed or renewed)
    return [ends[hours] for hours in sorted(ends)]
