"""What identifies all that a history says of a unit."""

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence


def fingerprint(evidence: "Evidence", *others: object) -> str:
    """Return what identifies all that a history says of a unit, and `others` by their `repr`."""
    digest = hashlib.sha256()
    said = evidence.unit, evidence.hours, evidence.replacements, evidence.stresses, evidence.failures
    digest.update(repr(said).encode())
    for one in evidence.observations:
        digest.update(repr((one.hours, one.explained)).encode())
        for values in (one.level, one.covariance, one.seen, np.asarray(one.shared)):
            digest.update(values.tobytes())
    digest.update(repr(others).encode())
    return digest.hexdigest()
