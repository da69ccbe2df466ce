"""`emaphm limits`: at which level of each fault each requirement of an actuator fails."""

from typing import TYPE_CHECKING, Any

from emaphm.cli.options import ActuatorFile, AsJson, FaultList, described_actuator, fault_vector
from emaphm.cli.output import show

if TYPE_CHECKING:
    from emaphm.prognosis import FailureLevels


def limits(*, actuator: ActuatorFile = "thesis", fault: FaultList = (), as_json: AsJson = False) -> None:
    """Show at which level of each fault each of the actuator's [[requirements]] fails."""
    faults = fault_vector(fault)
    described = described_actuator(actuator)
    from emaphm.actuator.faults import HEALTHY
    from emaphm.prognosis import Requirements, failure_levels
    from emaphm.text_table import NOTHING, format_table

    found = failure_levels(described, faults)
    stated = Requirements(described).stated
    values: dict[str, Any] = {
        "actuator": described.name,
        "stated": stated,
        "k": faults.vector.tolist(),
        "requirements": [_entry(one) for one in found],
    }
    names = list(found[0].levels)
    rows = [(one.limit.label, f"{one.value:.4g}", *(_levels(one, name) for name in names)) for one in found]
    lines = [format_table(("requirement", "value", *names), rows)]
    if not stated:
        lines.append("the actuator states no [[requirements]]: shown is the end of each scale")
    lines += [_violated(one, by_a_new_one=faults == HEALTHY) for one in found if one.violated]
    lines += [f"no single fault violates it: {one.limit.label}" for one in found if not one.can_fail]
    lines.append(f"{NOTHING}: no level of this fault violates the requirement; ↓: falling to this level does")
    show(values, "\n".join(lines), as_json)


def _entry(one: "FailureLevels") -> dict[str, Any]:
    return {
        "requirement": one.limit.label,
        "component": one.limit.component,
        "measure": one.limit.requirement.measure,
        "at_most" if one.limit.upper else "at_least": one.limit.bound,
        "unit": one.limit.unit,
        "value": one.value,
        "violated": one.violated,
        "can_fail": one.can_fail,
        "fails_at": {name: {"rising": up, "falling": down} for name, (up, down) in one.levels.items()},
    }


def _violated(one: "FailureLevels", *, by_a_new_one: bool) -> str:
    if not by_a_new_one:
        return f"violated already: {one.limit.label}"
    return f"a new actuator violates it: {one.limit.label}; correct the limit, or the description"


def _levels(one: "FailureLevels", name: str) -> str:
    from emaphm.text_table import NOTHING

    up, down = one.levels[name]
    parts = [*([f"{up:.3f}"] if up is not None else []), *([f"↓ {down:.3f}"] if down is not None else [])]
    return ", ".join(parts) or NOTHING
