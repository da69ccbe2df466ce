"""What identifies all that a history says of a unit."""

import hashlib
from dataclasses import fields

import numpy as np

from emaphm.prognosis.evidence import Evidence


def fingerprint(evidence: Evidence, *others: object) -> str:
    """Return what identifies all fields of a unit's evidence, and `others` by their `repr`."""
    names = [one.name for one in fields(evidence) if one.name != "observations"]
    digest = hashlib.sha256(repr([getattr(evidence, name) for name in names]).encode())
    for observation in evidence.observations:
        for one in fields(observation):
            value = getattr(observation, one.name)
            # The text of an array leaves digits out.
            digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    digest.update(repr(others).encode())
    return digest.hexdigest()
