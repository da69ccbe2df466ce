"""Which source made a result: results of another one are not to be mixed unawares."""

import hashlib
from pathlib import Path

import emaphm

DECIDING = (
    "actuator",
    "simulation",
    "recording",
    "optimizers",
    "estimation",
    "diagnosis",
    "simulated_recording.py",
    "study/task.py",
)
"""The rooms and files whose code decides what a run finds."""


def _revision() -> str:
    root = Path(emaphm.__file__).parent
    digest = hashlib.sha256()
    for name in DECIDING:
        place = root / name
        for source in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            digest.update(source.relative_to(root).as_posix().encode())
            digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


REVISION = _revision()
"""Of the source of those rooms, as loaded."""
