"""Fingerprint of an actuator's description, independent of its file."""

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emaphm.actuator import Actuator


def description_of(actuator: "Actuator") -> tuple[str, str]:
    """Return the SHA-256 of an actuator's TOML, and the TOML."""
    from emaphm.actuator.toml import write_toml

    toml = write_toml(actuator)
    return hashlib.sha256(toml.encode()).hexdigest(), toml
