"""Whether what a function was given for an actuator is one."""

from emaphm.actuator.actuator import Actuator
from emaphm.errors import ActuatorError


def check_actuator(given: object) -> None:
    """Refuse what is no `Actuator`, such as the name of a built-in one or of a file.

    Raises
    ------
    ActuatorError
        It is of another type.
    """
    if not isinstance(given, Actuator):
        raise ActuatorError(
            f"no actuator but a {type(given).__name__}; give what Actuator.thesis or Actuator.from_toml "
            "returns"
        )
