"""Faults and nuisances that a recording tells only together: their sum is known, the parts are not."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array

CONFOUNDED = 3.0
"""A coordinate is confounded where the others make its standard error larger by this factor."""

SHARE = 0.5
"""Share of a coordinate's variance that one direction must make for the coordinate to belong to it."""


@dataclass(frozen=True)
class Group:
    """Names of components and nuisances that act alike on the `channels`, in order.

    `remedies` are channels that would tell them apart, if recorded too.
    """

    members: tuple[str, ...]
    channels: tuple[str, ...]
    remedies: tuple[str, ...] = ()

    def others(self, name: str) -> str:
        """Return the members but one, in words."""
        return listed([member for member in self.members if member != name], "and")

    def __str__(self) -> str:
        """Return one sentence, and one on the remedies where there are any."""
        seen = listed(self.channels, "and")
        text = (
            f"{listed(self.members, 'and')} act alike on {seen}: what they make together is known, the "
            "parts are not."
        )
        if self.remedies:
            text += f" {listed(self.remedies, 'or')}, recorded too, would tell them apart."
        return text


def listed(names: Sequence[str], last: str) -> str:
    """Return names with commas between them, and a word before the last."""
    return f" {last} ".join(part for part in (", ".join(names[:-1]), names[-1]) if part)


def confounded(covariance: Array) -> list[NDArray[np.intp]]:
    """Return the coordinates, by index, of each direction of `covariance` (d, d) that confounds several.

    In units of what each coordinate's standard error would be if the others were known, a direction that
    is known much less well than its parts has a large eigenvalue, and its members the large loadings
    (variance decomposition: Belsley, Kuh and Welsch 1980, ch. 3).
    """
    alone = 1 / np.sqrt(np.diag(np.linalg.inv(covariance)))
    scaled = covariance / np.outer(alone, alone)
    values, directions = np.linalg.eigh(scaled)
    shares = values * directions**2 / np.diag(scaled)[:, np.newaxis]
    inflated = np.diag(scaled) > CONFOUNDED**2
    found = [
        np.flatnonzero(inflated & (shares[:, k] > SHARE)) for k in np.flatnonzero(values > CONFOUNDED**2)
    ]
    return [members for members in found if members.size > 1]


def remedies(covariance: Array, members: Iterable[int], more: Mapping[str, Array]) -> tuple[str, ...]:
    """Return the names of `more` information (d, d) that would tell the `members` apart.

    Those by which every member's standard error falls by half or more.
    """
    before = np.sqrt(np.diag(covariance))
    known = np.linalg.inv(covariance)
    chosen = list(members)
    helpful = []
    for name, information in more.items():
        after = np.sqrt(np.diag(np.linalg.inv(known + information)))
        if np.all(after[chosen] < before[chosen] / 2):
            helpful.append(name)
    return tuple(helpful)
