"""Which laws a calibration may find, and which only faults show."""

from emaphm.actuator.actuator import Actuator
from emaphm.actuator.laws.catalogue import LAWS, Law
from emaphm.actuator.unit.baseline import PARTS
from emaphm.errors import MethodError

SHOWN_BY_FAULTS = frozenset(name for law in LAWS.values() if law.by_faults for name in law.parameters)
"""Parameters that healthy recordings do not show, as phases are alike then."""


def laws_to_calibrate(actuator: Actuator) -> tuple[Law, ...]:
    """Return the laws that `actuator` may be given, and that healthy recordings show."""
    return tuple(law for law in LAWS.values() if law.is_possible(actuator) and not law.by_faults)


def check_calibrated(names: tuple[str, ...]) -> None:
    """Raise `MethodError` if healthy recordings do not show one of the parameters `names`."""
    for law in LAWS.values():
        for name in law.parameters:
            if law.by_faults and name in names:
                all_of_it = f"{', '.join(law.parameters)} in [{PARTS[name][0]}]"
                raise MethodError(
                    f"'{name}' of law '{law.name}' cannot be calibrated: phases that are alike do not show "
                    f"it; give {all_of_it} as measured, or leave them out: a diagnosis finds them where "
                    "faults show them"
                )
