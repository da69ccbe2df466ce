"""Random streams: each purpose has its own stream, a named child of the one seed of a call.

Streams of different names are independent (`numpy.random.SeedSequence`), so that a result is never evaluated
with the noise by which it was selected.
"""

import hashlib

import numpy as np

from emaphm.errors import SignalError


def check_seed(seed: int) -> None:
    """Refuse a negative seed, which random generators do not accept, with `SignalError`."""
    if seed < 0:
        raise SignalError(f"seed {seed} is negative; give 0 or more")


def seed_sequence(seed: int, *name: str | int) -> np.random.SeedSequence:
    """Return the child `name` of the seed sequence of `seed`.

    Parameters
    ----------
    seed
        0 or more.
    name
        Purpose and number of the stream, e.g. ``("bias correction", "start separation", 3)``.

    Raises
    ------
    SignalError
        The seed is negative.
    """
    check_seed(seed)
    # All digests have the same number of words, so that no name is the beginning of another.
    digest = hashlib.sha256(repr(name).encode()).digest()[:16]
    return np.random.SeedSequence(seed, spawn_key=tuple(np.frombuffer(digest, "<u4").tolist()))


def stream(seed: int, *name: str | int) -> np.random.Generator:
    """Return the random generator of the child `name` of `seed`; errors as in `seed_sequence`."""
    return np.random.default_rng(seed_sequence(seed, *name))


def child_seed(seed: int, *name: str | int) -> int:
    """Return the child `name` of `seed` as a whole number in [0, 2**31), for functions that take a seed."""
    return int(seed_sequence(seed, *name).generate_state(1)[0]) % 2**31
