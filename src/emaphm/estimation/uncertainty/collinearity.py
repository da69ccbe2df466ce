"""Collinear sets: parameters of which a recording identifies only a combination."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

VARIANCE_INFLATION = 3.0
"""Least factor by which unknown other coordinates increase the standard error of a collinear coordinate."""

VARIANCE_SHARE = 0.5
"""Least share of a coordinate's variance along a direction for the coordinate to belong to that direction."""

RESOLVED = 0.5
"""Largest factor on the standard error of every member at which a channel resolves the set."""


@dataclass(frozen=True)
class CollinearSet:
    """Names of components and nuisances with the same effect on the `channels`, in order.

    `resolving` are unrecorded channels that would separate them.
    """

    members: tuple[str, ...]
    channels: tuple[str, ...]
    resolving: tuple[str, ...] = ()

    def others(self, name: str) -> str:
        """Return all members except `name`, in words."""
        return listed([member for member in self.members if member != name], "and")

    def __str__(self) -> str:
        """Return one sentence, and a second one on the resolving channels if there are any."""
        text = (
            f"{listed(self.members, 'and')} act alike on {listed(self.channels, 'and')}: their combined "
            "effect is known, each alone is not."
        )
        if self.resolving:
            text += f" Recording {listed(self.resolving, 'or')} too would separate them."
        return text


def listed(names: Sequence[str], last: str) -> str:
    """Return `names` separated by commas, with the word `last` before the last name."""
    return f" {last} ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)


def collinear_coordinates(covariance: Array) -> list[NDArray[np.intp]]:
    """Return the indices of the coordinates of each collinear set in `covariance` (d, d).

    The covariance is scaled by each coordinate's standard error for known other coordinates. A direction that
    is much less certain than its members then has a large eigenvalue, and its members have large shares of
    their variance in it (variance decomposition: Belsley, Kuh and Welsch 1980, ch. 3).
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
    """Return the channels whose additional `information` (d, d) would separate the `members`.

    Such a channel reduces the standard error of every member by the factor `RESOLVED` or more.
    """
    before = np.sqrt(np.diag(covariance))
    precision = np.linalg.inv(covariance)
    indices = list(members)
    resolving = []
    for name, added in information.items():
        after = np.sqrt(np.diag(np.linalg.inv(precision + added)))
        if np.all(after[indices] < RESOLVED * before[indices]):
            resolving.append(name)
    return tuple(resolving)
