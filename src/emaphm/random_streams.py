"""Random numbers: each use has a stream of its own, a named child of the call's one seed.

Streams of different names share no numbers, whatever the names (`numpy.random.SeedSequence`), so that no
result has chosen the noise that it is later judged by.
"""

import hashlib

import numpy as np

from emaphm.errors import SignalError


def check_seed(seed: int) -> None:
    """Refuse a seed that is below 0, which no generator takes; `SignalError` says so."""
    if seed < 0:
        raise SignalError(f"seed {seed} is negative; give 0 or more")


def seed_sequence(seed: int, *name: str | int) -> np.random.SeedSequence:
    """Return the child `name` of the seed sequence of `seed`.

    Parameters
    ----------
    seed
        0 or more.
    name
        What the numbers are for, and which of several: ``("bias correction", "start separation", 3)``.

    Raises
    ------
    SignalError
        The seed is negative.
    """
    check_seed(seed)
    # A digest has always as many words, so that no name is the beginning of another.
    digest = hashlib.sha256(repr(name).encode()).digest()[:16]
    return np.random.SeedSequence(seed, spawn_key=tuple(np.frombuffer(digest, "<u4").tolist()))


def stream(seed: int, *name: str | int) -> np.random.Generator:
    """Return the generator of the child `name` of `seed`; errors as in `seed_sequence`."""
    return np.random.default_rng(seed_sequence(seed, *name))


def child_seed(seed: int, *name: str | int) -> int:
    """Return a seed in [0, 2**31) for what takes a number: of the child `name` of `seed`."""
    return int(seed_sequence(seed, *name).generate_state(1)[0]) % 2**31
