"""Lives of units and of their components, which end by failure or are censored."""

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
        """Whether the life continues, or ended without a failure."""
        return not self.failed

    def to_dict(self) -> dict[str, Any]:
        """Return the life, ready for `json.dumps`."""
        return asdict(self) | {"censored": self.censored}


def latest_hours(
    flights: Sequence[Flight], removals: Sequence[Removal], findings: Sequence[Finding]
) -> float:
    """Return the hours of a unit's latest entry [h]: a flight, a removal or a finding."""
    return max((entry.hours for entries in (flights, removals, findings) for entry in entries), default=0.0)


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

    A removal ends a life of the unit by failure if a shop found a failure at the same hours; without any
    finding at these hours, if failure was its reason. A component's life ends when it is found failed or is
    replaced; the next life starts with a replacement. The last life lasts until the unit's latest hours, and
    is censored.
    """
    hours = latest_hours(flights, removals, findings)
    is_unit = component in (None, UNIT)
    ends = _ends_of_unit(removals, findings) if is_unit else _ends_of_component(str(component), findings)
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
    """Return the unrepaired failure of a unit; None if it is in service, or may be in service again.

    The unit failed if a removal ended its life by failure, as in `lives`, or if a shop found a component
    failed. It is in service again after a replacement at these hours or later, or a later flight or removal.
    """
    failed = [finding for finding in findings if finding.condition == "failed"]
    ends = [end.hours for end in _ends_of_unit(removals, findings) if end.failed]
    hours = max((*ends, *(finding.hours for finding in failed)), default=None)
    if hours is None or any(finding.replaced and finding.hours >= hours for finding in findings):
        return None
    if (
        max((*(flight.hours for flight in flights), *(removal.hours for removal in removals)), default=0.0)
        > hours
    ):
        return None
    components = {finding.component for finding in failed if finding.hours == hours} - {UNIT}
    return Failure(hours, tuple(sorted(components)))


@dataclass(frozen=True)
class OpenRemoval:
    """A removal as failed at `hours` [h], for which a shop has `named` components, none as failed."""

    hours: float
    named: tuple[str, ...]


def not_replaced(findings: Sequence[Finding]) -> tuple[Failure, ...]:
    """Return the failures of components without a known replacement, by hours."""
    renewed = [(finding.component, finding.hours) for finding in findings if finding.replaced]
    failed: dict[float, set[str]] = {}
    for finding in findings:
        is_renewed = any(
            component in (finding.component, UNIT) and hours >= finding.hours for component, hours in renewed
        )
        if finding.condition == "failed" and finding.component != UNIT and not is_renewed:
            failed.setdefault(finding.hours, set()).add(finding.component)
    return tuple(Failure(hours, tuple(sorted(failed[hours]))) for hours in sorted(failed))


def open_removal(
    flights: Sequence[Flight], removals: Sequence[Removal], findings: Sequence[Finding]
) -> OpenRemoval | None:
    """Return the last removal as failed for which a shop has named no failed component; None without one.

    It is closed by a finding on the unit as a whole, a replacement at these hours or later, a flight, or
    another removal.
    """
    last = max(removals, key=lambda removal: removal.hours, default=None)
    if last is None or last.reason != "failed" or any(flight.hours > last.hours for flight in flights):
        return None
    reported = [finding for finding in findings if finding.hours == last.hours]
    is_closed = any(finding.component == UNIT or finding.condition == "failed" for finding in reported)
    is_renewed = any(finding.replaced and finding.hours >= last.hours for finding in findings)
    if not reported or is_closed or is_renewed:
        return None
    return OpenRemoval(last.hours, tuple(sorted(finding.component for finding in reported)))


@dataclass(frozen=True)
class _End:
    """End of a life at `hours` [h]; another life starts there if the component was `renewed`."""

    hours: float
    failed: bool
    renewed: bool


def _ends_of_unit(removals: Sequence[Removal], findings: Sequence[Finding]) -> list[_End]:
    """Return the ends of lives of a unit, by its removals."""
    failed: dict[float, list[bool]] = {}
    for finding in findings:
        failed.setdefault(finding.hours, []).append(finding.condition == "failed")
    return [
        _End(removal.hours, any(failed.get(removal.hours, [removal.reason == "failed"])), renewed=True)
        for removal in removals
    ]


def _ends_of_component(component: str, findings: Sequence[Finding]) -> list[_End]:
    """Return the ends of lives of a component, by the findings on it."""
    ends: dict[float, _End] = {}
    for finding in findings:
        failed = finding.component == component and finding.condition == "failed"
        renewed = finding.replaced and finding.component in (component, UNIT)
        if failed or renewed:
            previous = ends.get(finding.hours, _End(finding.hours, failed=False, renewed=False))
            ends[finding.hours] = _End(finding.hours, previous.failed or failed, previous.renewed or renewed)
    return [ends[hours] for hours in sorted(ends)]
