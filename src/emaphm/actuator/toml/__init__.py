"""Actuator TOML: writing with units, and one-line messages on errors in it."""

from emaphm.actuator.toml.complaints import validation_message
from emaphm.actuator.toml.writing import write_toml

__all__ = ["validation_message", "write_toml"]
