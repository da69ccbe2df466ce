"""Functions that spoil bytes, text and numbers."""

from collections.abc import Callable
from random import Random

import numpy as np

from emaphm.arrays import Array

ODD_NUMBERS = (
    "0", "-0.0", "1e308", "-1e308", "1e-308", "5e-324", "1e300", "1e-300", "nan", "inf", "-inf", "1e999", "",
    " ", "1,5", "0x10", "1_000", "١", "1e", "--1", "+-1", "1.5", "true", "None", "1" * 5000, "9" * 25,
    "1e-15", "-1", "1e15",
)  # fmt: skip
"""Odd texts in place of a number."""

ODD_TEXTS = (
    "", " ", "\0", "a\0b", "\n", "\x1b[31m", "ü" * 300, "x" * 5000, "..", "/", "~", "*", "[", "%s", "{}", "'",
    '"', "\udcff", "None", "-", "--", "=", "a=b=c", "nul", "NaN", "\u202e", "💥", ",", ",,", ";", "friction",
)  # fmt: skip
"""Odd texts in place of a name."""

MAGNETIC = (0, 1, 0x7F, 0x80, 0xFF)
"""Bytes at the limits of integers."""


def flipped(content: bytes, random: Random) -> bytes:
    """Return `content` with one to eight bytes replaced."""
    spoilt = bytearray(content)
    for _ in range(random.choice((1, 1, 1, 2, 8))):
        spoilt[random.randrange(len(spoilt))] = random.choice((*MAGNETIC, random.randrange(256)))
    return bytes(spoilt)


def cut(content: bytes, random: Random) -> bytes:
    """Return the beginning of `content`."""
    return content[: random.randrange(len(content))]


def inserted(content: bytes, random: Random) -> bytes:
    """Return `content` with random bytes, or a copy of a piece of it, inserted at a random place."""
    place, length = random.randrange(len(content)), random.choice((1, 2, 8, 100))
    piece = random.randbytes(length) if random.random() < 0.5 else content[place : place + length]
    return content[:place] + piece + content[place:]


def dropped(content: bytes, random: Random) -> bytes:
    """Return `content` without a piece."""
    place = random.randrange(len(content))
    return content[:place] + content[place + random.choice((1, 4, 8, 100)) :]


def blanked(content: bytes, random: Random) -> bytes:
    """Return `content` with a piece of it overwritten by one byte."""
    place, length = random.randrange(len(content)), random.choice((4, 10, 64))
    piece = bytes([random.choice(MAGNETIC)]) * length
    return content[:place] + piece + content[place + length :]


def unchanged(content: bytes, _: Random) -> bytes:
    """Return `content`."""
    return content


BYTEWISE: tuple[Callable[[bytes, Random], bytes], ...] = (flipped, cut, inserted, dropped, blanked)


def near(content: bytes, places: tuple[int, int], random: Random) -> bytes:
    """Return `content` spoilt only between two places, such as a header."""
    first, last = places
    spoilt = random.choice((flipped, blanked, inserted, dropped))(content[first:last], random)
    return content[:first] + spoilt + content[last:]


def values(column: Array, random: Random) -> Array:
    """Return a column as from a broken sensor or a wrong conversion."""
    spoilt, row = column.copy(), random.randrange(column.size)
    match random.randrange(7):
        case 0:
            spoilt[:] = random.choice((0.0, 0.0, 1.0, -1.0, 1e-9, 293.15, np.nan, 1e308, 5e-324, np.inf))
        case 1:
            spoilt *= 10.0 ** random.choice((-323, -300, -150, -20, -9, -3, 3, 9, 20, 150, 300))
        case 2:
            spoilt[row] = random.choice((1e308, -1e308, 5e-324, np.nan, np.inf, 1e15, 1e16, -1e12, 1e6))
        case 3:
            spoilt[row:] = spoilt[row]
        case 4:
            spoilt *= -1
        case 5:
            np.random.default_rng(random.randrange(2**32)).shuffle(spoilt)
        case _:
            with np.errstate(over="ignore"):
                spoilt = np.round(spoilt, random.randrange(-1, 4))
    return spoilt
