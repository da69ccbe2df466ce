"""A note on a friction that goes with the load: of the load, and not of wear, for all that is seen."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.prognosis.columns import columns_of

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

FRICTION = CARTESIAN_NAMES.index("friction")

FEWEST = 4
"""Diagnoses with a load from which on a correlation says something."""

CHANCE = 0.005
"""Probability by which independent pairs may be as alike, below which a note says so."""

ALIKE = 0.95
"""Correlation of friction and load from which on a note says so."""

LEAST_DIFFERENT = 3
"""Different loads from which on a line is seen: between two, wear of the hours between is as good a cause."""

APART = 0.1
"""Share of the range of the loads by which neighbouring ones are different."""

LARGEST_CHANCE = 3.0
"""Rms deviation of the friction, in its standard errors, from which on it varies at all."""


def load_notes(evidence: "Evidence") -> list[str]:
    """Return a note where the friction of the diagnoses since the last replacement goes with their load.

    It must do so without any single one of them too: one diagnosis that differs in both from all others, as
    with the first load or the first wear, makes any correlation.
    """
    since = max((at for at, part in evidence.replacements if FRICTION in columns_of(part)), default=-1.0)
    seen = [one for one in evidence.used if one.hours > since and one.seen[FRICTION] and one.load is not None]
    friction = np.array([one.level[FRICTION] for one in seen])
    load = np.array([one.load for one in seen], float)
    if friction.size < FEWEST or _different(load) < LEAST_DIFFERENT:
        return []
    own = float(np.sqrt(np.mean([one.covariance[FRICTION, FRICTION] for one in seen])))
    alike = _correlation(friction, load, own)
    without = [_correlation(np.delete(friction, i), np.delete(load, i), own) for i in range(friction.size)]
    least = min(abs(alike), *(one * np.sign(alike) for one in without))
    if least < ALIKE or _by_chance(alike, friction.size) > CHANCE:
        return []
    note = (
        f"the friction goes with the load that the diagnoses estimated (correlation {alike:.2f} of "
        f"{friction.size}): it may be friction of the load, which the description lacks and which looks like "
        "wear where loads rise; calibrate under several loads with the law load-dependent"
    )
    return [note]


def _different(load: Array) -> int:
    """Return how many different loads there are: groups that are apart by `APART` of the range of all."""
    gaps = np.diff(np.sort(load))
    return 1 + int(np.sum(gaps > APART * np.sum(gaps)))


def _correlation(friction: Array, load: Array, own: float) -> float:
    """Return the correlation; 0 where a load is constant, or a friction by its standard error `own`."""
    if np.ptp(load) == 0 or np.std(friction) <= LARGEST_CHANCE * own:
        return 0.0
    return float(np.corrcoef(friction, load)[0, 1])


def _by_chance(correlation: float, pairs: int) -> float:
    """Return the probability that independent normal pairs are as alike: Student's t of pairs - 2 degrees."""
    from scipy.special import stdtr

    rest = max(1 - correlation**2, np.finfo(float).tiny)
    return float(2 * stdtr(pairs - 2, -abs(correlation) * ((pairs - 2) / rest) ** 0.5))
