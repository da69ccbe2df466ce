"""Note on a friction that correlates with the load: it may be friction of the load and not wear."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array

if TYPE_CHECKING:
    from emaphm.prognosis.evidence import Evidence

FRICTION = CARTESIAN_NAMES.index("friction")

FEWEST = 4
"""Least number of diagnoses with a load for a correlation."""

CHANCE = 0.005
"""Probability of such a correlation of independent pairs, below which there is a note."""

ALIKE = 0.95
"""Correlation of friction and load from which on there is a note."""

LEAST_DIFFERENT = 3
"""Least number of different loads: with two, wear between their hours is an equally good explanation."""

APART = 0.1
"""Difference of neighbouring loads, as a share of the range of loads, from which on they are different."""

LARGEST_CHANCE = 3.0
"""Standard deviation of the friction, in its standard errors, from which on it is taken to vary."""


def load_notes(evidence: "Evidence") -> list[str]:
    """Return a note if the friction of the diagnoses since the last replacement correlates with their load.

    The correlation must persist without each single diagnosis: a diagnosis that differs in both quantities
    from all others, as with the first load or the first wear, causes a correlation by itself.
    """
    diagnoses = [
        diagnosis for diagnosis in evidence.since_replacement(FRICTION) if diagnosis.load is not None
    ]
    friction = np.array([diagnosis.level[FRICTION] for diagnosis in diagnoses])
    load = np.array([diagnosis.load for diagnosis in diagnoses], float)
    if friction.size < FEWEST or _count_of_loads(load) < LEAST_DIFFERENT:
        return []
    standard_error = float(
        np.sqrt(np.mean([diagnosis.covariance[FRICTION, FRICTION] for diagnosis in diagnoses]))
    )
    correlation = _correlation(friction, load, standard_error)
    leave_one_out = [
        _correlation(np.delete(friction, i), np.delete(load, i), standard_error) for i in range(friction.size)
    ]
    smallest = min(abs(correlation), *(value * np.sign(correlation) for value in leave_one_out))
    if smallest < ALIKE or _p_value(correlation, friction.size) > CHANCE:
        return []
    note = (
        f"the friction correlates with the load that the diagnoses estimated (correlation {correlation:.2f} "
        f"of {friction.size}): it may be friction of the load, which the description lacks and which looks "
        "like wear if loads rise; calibrate under several loads with the law load-dependent"
    )
    return [note]


def _count_of_loads(load: Array) -> int:
    """Return the number of different loads: groups that differ by `APART` of the range of all loads."""
    gaps = np.diff(np.sort(load))
    return 1 + int(np.sum(gaps > APART * np.sum(gaps)))


def _correlation(friction: Array, load: Array, standard_error: float) -> float:
    """Return the correlation; 0 if the load is constant, or the friction within its standard error."""
    if np.ptp(load) == 0 or np.std(friction) <= LARGEST_CHANCE * standard_error:
        return 0.0
    return float(np.corrcoef(friction, load)[0, 1])


def _p_value(correlation: float, pairs: int) -> float:
    """Return the p-value of a `correlation` of independent normal pairs: Student's t, pairs - 2 degrees."""
    from scipy.special import stdtr

    unexplained = max(1 - correlation**2, np.finfo(float).tiny)
    return float(2 * stdtr(pairs - 2, -abs(correlation) * ((pairs - 2) / unexplained) ** 0.5))
