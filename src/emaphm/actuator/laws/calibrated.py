"""Optional laws that a calibration can identify from healthy recordings."""

from emaphm.actuator.actuator import Actuator
from emaphm.actuator.laws.catalogue import LAWS, Law
from emaphm.actuator.unit.baseline import PARTS
from emaphm.errors import MethodError

SHOWN_BY_FAULTS = frozenset(name for law in LAWS.values() if law.by_faults for name in law.parameters)
"""Parameters that are not identifiable from healthy recordings, because the phases are equal there."""


def laws_to_calibrate(actuator: Actuator) -> tuple[Law, ...]:
    """Return the laws that can be added to `actuator` and are identifiable from healthy recordings."""
    return tuple(law for law in LAWS.values() if law.is_possible(actuator) and not law.by_faults)


def check_calibrated(names: tuple[str, ...]) -> None:
    """Raise `MethodError` if one of the parameters `names` is not identifiable from healthy recordings."""
    for law in LAWS.values():
        for name in law.parameters:
            if law.by_faults and name in names:
                parameters = f"{', '.join(law.parameters)} in [{PARTS[name][0]}]"
                raise MethodError(
                    f"'{name}' of law '{law.name}' cannot be calibrated: phases that are alike do not show "
                    f"it; give {parameters} as measured, or leave them out: a diagnosis finds them where "
                    "faults show them"
                )
