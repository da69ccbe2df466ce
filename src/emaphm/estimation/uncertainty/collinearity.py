"""Collinear sets: parameters of which a recording identifies only a combination."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

VARIANCE_INFLATION = 3.0
"""Factor on a coordinate's standard error, by the others being unknown, from which it is collinear."""

VARIANCE_SHARE = 0.5
"""Least share of a coordinate's variance along one direction, for the coordinate to belong to it."""

RESOLVED = 0.5
"""Factor on the standard error of every member to which a channel must bring it to resolve the set."""


@dataclass(frozen=True)
class CollinearSet:
    """Names of components and nuisances that act alike on the `channels`, in order.

    `resolving` are channels that would separate them, if recorded too.
    """

    members: tuple[str, ...]
    channels: tuple[str, ...]
    resolving: tuple[str, ...] = ()

    def others(self, name: str) -> str:
        """Return the members but one, in words."""
        return listed([member for member in self.members if member != name], "and")

    def __str__(self) -> str:
        """Return one sentence, and one on the resolving channels where there are any."""
        text = (
            f"{listed(self.members, 'and')} act alike on {listed(self.channels, 'and')}: their combined "
            f"effect "
            "is known, each alone is not."
        )
        if self.resolving:
            text += f" Recording {listed(self.resolving, 'or')} too would separate them."
        return text


def listed(names: Sequence[str], last: str) -> str:
    """Return names with commas between them, and a word before the last."""
    return f" {last} ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)


def collinear_coordinates(covariance: Array) -> list[NDArray[np.intp]]:
    """Return the coordinates, by index, of each set that `covariance` (d, d) shows.

    In units of what each coordinate's standard error would be if the others were known, a direction that
    is known much less well than its members has a large eigenvalue, and its members have large shares of
    their variance there (variance decomposition: Belsley, Kuh and Welsch 1980, ch. 3).
    """
    alone = 1 / np.sqrt(np.diag(np.linalg.inv(covariance)))
    scaled = covariance / np.outer(alone, alone)
    values, directions = np.linalg.eigh(scaled)
    shares = values * directions**2 / np.diag(scaled)[:, np.newaxis]
    inflated = np.diag(scaled) > VARIANCE_INFLATION**2
    sets = [
        np.flatnonzero(inflated & (shares[:, k] > VARIANCE_SHARE))
        for k in np.flatnonzero(values > VARIANCE_INFLATION**2)
    ]
    return [members for members in sets if members.size > 1]


def resolving_channels(
    covariance: Array, members: Iterable[int], information: Mapping[str, Array]
) -> tuple[str, ...]:
    """Return the channels whose `information` (d, d), added, would separate the `members`.

    Those by which every member's standard error falls to `RESOLVED` of itself or less.
    """
    before = np.sqrt(np.diag(covariance))
    known = np.linalg.inv(covariance)
    chosen = list(members)
    helpful = []
    for name, added in information.items():
        after = np.sqrt(np.diag(np.linalg.inv(known + added)))
        if np.all(after[chosen] < RESOLVED * before[chosen]):
            helpful.append(name)
    return tuple(helpful)
