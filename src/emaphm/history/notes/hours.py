"""Whether the hours of a removal or a shop's finding agree with the other entries of its unit."""

from emaphm.history.records import Finding, Removal
from emaphm.history.unit import Unit


def implausible_removal(unit: Unit, removal: Removal) -> str | None:
    """Return what may be wrong with the hours of a removal of a unit of a history, None where they fit.

    They fit from its last recording on, up to as many hours later as it was recorded over before.
    """
    hours = [one.hours for one in unit.flights()]
    if not hours:
        return None
    wrong = f"if {removal.hours:.9g} h is wrong, 'emaphm history withdraw' takes the removal out"
    later = sum(one > removal.hours for one in hours)
    if later:
        return (
            f"recordings of {unit.serial_number} after this removal: {later}, up to {hours[-1]:.9g} h; it "
            f"counts as in service again; {wrong}"
        )
    if len(hours) > 1 and removal.hours - hours[-1] > hours[-1] - hours[0]:
        return f"the last recording of {unit.serial_number} is of {hours[-1]:.9g} h; {wrong}"
    return None


def implausible_finding(unit: Unit, finding: Finding) -> str | None:
    """Return what may be wrong with the hours of a finding on a unit of a history, None where they fit.

    They fit where they are those of a removal; without any removal, up to those of the last recording.
    """
    removed = [one.hours for one in unit.removals()]
    if finding.hours in removed:
        return None
    if removed:
        near = min(removed, key=lambda hours: abs(hours - finding.hours))
        return (
            f"{unit.serial_number} has no removal at {finding.hours:.9g} h, the nearest is at {near:.9g} h: "
            "whether the unit had failed there is judged by findings of the same hours only; if these hours "
            "are wrong, 'emaphm history withdraw' takes the finding out"
        )
    last = max((one.hours for one in unit.flights()), default=0.0)
    if finding.hours <= last:
        return None
    return (
        f"the last recording of {unit.serial_number} is of {last:.9g} h, and it has no removal; if "
        f"{finding.hours:.9g} h is wrong, 'emaphm history withdraw' takes the finding out"
    )
