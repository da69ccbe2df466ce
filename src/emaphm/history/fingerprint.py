"""What makes a recording, and an actuator's description, the same one wherever it comes from."""

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from emaphm.actuator import Actuator
    from emaphm.recording import Recording


def recording_hash(recording: "Recording") -> str:
    """Return the SHA-256 of a recording's channels: names, values and how they were sampled, no file name.

    The same values in another file, or in a file of another format, are the same recording.
    """
    digest = hashlib.sha256(f"{recording.sampling} {recording.samples}".encode())
    for name in sorted(recording.names):
        digest.update(f"\n{name}\n".encode("utf-8", "backslashreplace"))
        # Adding 0 makes -0.0 the 0.0 that another format may write for it.
        digest.update((np.asarray(recording[name]) + 0.0).astype("<f8").tobytes())
    return digest.hexdigest()


def description_of(actuator: "Actuator") -> tuple[str, str]:
    """Return the SHA-256 of an actuator's TOML, and the TOML."""
    from emaphm.actuator.toml import write_toml

    toml = write_toml(actuator)
    return hashlib.sha256(toml.encode()).hexdigest(), toml
