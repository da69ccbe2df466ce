"""Fingerprint of the evidence on a unit."""

import hashlib
from dataclasses import fields

import numpy as np

from emaphm.prognosis.evidence import Evidence


def fingerprint(evidence: Evidence, *others: object) -> str:
    """Return a SHA-256 of all fields of a unit's evidence, and of the `repr` of `others`."""
    names = [item.name for item in fields(evidence) if item.name != "observations"]
    digest = hashlib.sha256(repr([getattr(evidence, name) for name in names]).encode())
    for observation in evidence.observations:
        for item in fields(observation):
            value = getattr(observation, item.name)
            # The `repr` of an array omits digits.
            digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    digest.update(repr(others).encode())
    return digest.hexdigest()
