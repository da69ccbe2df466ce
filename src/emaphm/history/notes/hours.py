"""Plausibility of the hours of a removal or a shop's finding, compared with other entries of the unit."""

from emaphm.history.records import Finding, Removal
from emaphm.history.unit import Unit


def implausible_removal(unit: Unit, removal: Removal) -> str | None:
    """Return a text on implausible hours of a unit's removal, None if they are plausible.

    Plausible hours are not below the last recording, and later by at most the hours from the first to the
    last.
    """
    hours = [flight.hours for flight in unit.flights()]
    if not hours:
        return None
    remedy = f"if {removal.hours:.9g} h is wrong, withdraw the removal with 'emaphm history withdraw'"
    later_count = sum(recorded > removal.hours for recorded in hours)
    if later_count:
        return (
            f"recordings of {unit.serial_number} after this removal: {later_count}, up to {hours[-1]:.9g} "
            f"h; the unit counts as in service again; {remedy}"
        )
    if len(hours) > 1 and removal.hours - hours[-1] > hours[-1] - hours[0]:
        return f"the last recording of {unit.serial_number} is of {hours[-1]:.9g} h; {remedy}"
    return None


def implausible_finding(unit: Unit, finding: Finding) -> str | None:
    """Return a text on implausible hours of a finding on a unit, None if they are plausible.

    Plausible hours are those of a removal; without any removal, hours up to those of the last recording.
    """
    removed = [removal.hours for removal in unit.removals()]
    if finding.hours in removed:
        return None
    if removed:
        near = min(removed, key=lambda hours: abs(hours - finding.hours))
        return (
            f"{unit.serial_number} has no removal at {finding.hours:.9g} h, the nearest is at {near:.9g} h: "
            "only findings at the same hours decide whether the unit had failed at a removal; if these hours "
            "are wrong, withdraw the finding with 'emaphm history withdraw'"
        )
    last = max((flight.hours for flight in unit.flights()), default=0.0)
    if finding.hours <= last:
        return None
    return (
        f"the last recording of {unit.serial_number} is of {last:.9g} h, and it has no removal; if "
        f"{finding.hours:.9g} h is wrong, withdraw the finding with 'emaphm history withdraw'"
    )
