"""What this process has computed of other units: a fleet is followed once, not for each unit that asks."""

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from threading import Lock
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

T = TypeVar("T")


class Memory(Generic[T]):
    """Up to `most` values by key, of which those not asked for the longest are forgotten first."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._values: OrderedDict[str, T] = OrderedDict()
        self._lock = Lock()

    def get(self, key: str, compute: Callable[[], T]) -> T:
        """Return the value of `key`, computed where it is not known; a failure is not remembered."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        value = compute()
        with self._lock:
            self._values[key] = value
            while len(self._values) > self._most:
                self._values.popitem(last=False)
        return value


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
