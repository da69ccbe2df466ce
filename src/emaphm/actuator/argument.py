"""Type check of an argument that must be an `Actuator`."""

from emaphm.actuator.actuator import Actuator
from emaphm.errors import ActuatorError


def check_actuator(given: object) -> None:
    """Refuse an argument that is not an `Actuator`, such as the name of a preset or of a file.

    Raises
    ------
    ActuatorError
        The argument is of another type.
    """
    if not isinstance(given, Actuator):
        raise ActuatorError(
            f"no actuator but a {type(given).__name__}; give what Actuator.thesis or Actuator.from_toml "
            "returns"
        )
