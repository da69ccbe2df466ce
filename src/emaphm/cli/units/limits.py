"""The verb `limits`: the level of each fault at which each requirement of an actuator fails."""

from typing import TYPE_CHECKING, Any

from emaphm.cli.options import ActuatorFile, AsJson, FaultList, described_actuator, fault_vector
from emaphm.cli.output import show

if TYPE_CHECKING:
    from emaphm.prognosis import FailureLevels


def limits(*, actuator: ActuatorFile = "thesis", fault: FaultList = (), as_json: AsJson = False) -> None:
    """Show the level of each fault at which each of the actuator's [[requirements]] fails."""
    faults = fault_vector(fault)
    described = described_actuator(actuator)
    from emaphm.actuator.faults import HEALTHY
    from emaphm.prognosis import Requirements, failure_levels
    from emaphm.text_table import NOTHING, format_table

    requirements = failure_levels(described, faults)
    stated = Requirements(described).stated
    values: dict[str, Any] = {
        "actuator": described.name,
        "stated": stated,
        "k": faults.vector.tolist(),
        "requirements": [_entry(required) for required in requirements],
    }
    names = requirements[0].levels
    rows = [(required.limit.label, f"{required.value:.4g}", *_levels(required)) for required in requirements]
    lines = [format_table(("requirement", "value", *names), rows)]
    if not stated:
        lines.append("the actuator states no [[requirements]]: the table shows the end of each scale")
    lines += [
        _violation(required, is_new=faults == HEALTHY) for required in requirements if required.violated
    ]
    lines += [
        f"no single fault violates this requirement: {required.limit.label}"
        for required in requirements
        if not required.can_fail
    ]
    lines.append(
        f"{NOTHING}: no level of this fault violates the requirement; ↓: a fall to this level violates it"
    )
    show(values, "\n".join(lines), as_json)


def _entry(required: "FailureLevels") -> dict[str, Any]:
    return {
        "requirement": required.limit.label,
        "component": required.limit.component,
        "measure": required.limit.requirement.measure,
        "at_most" if required.limit.upper else "at_least": required.limit.bound,
        "unit": required.limit.unit,
        "value": required.value,
        "violated": required.violated,
        "can_fail": required.can_fail,
        "fails_at": {name: {"rising": up, "falling": down} for name, (up, down) in required.levels.items()},
    }


def _violation(required: "FailureLevels", *, is_new: bool) -> str:
    """Return a line on a requirement that the actuator violates with the given faults."""
    if not is_new:
        return f"violated already: {required.limit.label}"
    return (
        f"violated already by a new actuator: {required.limit.label}; correct the limit, or the description"
    )


def _levels(required: "FailureLevels") -> list[str]:
    """Return the failure level of each fault as text, empty if the requirement is violated already."""
    if required.violated:
        return [""] * len(required.levels)
    return [_level(up, down) for up, down in required.levels.values()]


def _level(up: float | None, down: float | None) -> str:
    from emaphm.text_table import NOTHING

    parts = [*([f"{up:.3f}"] if up is not None else []), *([f"↓ {down:.3f}"] if down is not None else [])]
    return ", ".join(parts) or NOTHING
