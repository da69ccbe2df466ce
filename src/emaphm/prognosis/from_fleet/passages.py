"""When a component passes shares of the way to its limit: what its diagnoses say of its pace."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from emaphm.arrays import Array

if TYPE_CHECKING:
    from collections.abc import Sequence

SHARES = np.linspace(0.1, 1.0, 10)
"""Of the way from new to the limit whose passages are looked at: the first one above what new components
differ by, then even steps, each some check flights long."""

LEAST_HOURS, LEAST_SHARE = 5.0, 0.01
"""Of a step [h], or as a share of the fleet's median life where that is less: jumps may take a component over
several at once."""

LEAST_WAIT = 0.2
"""Of the hours before the first step, as a share of those."""

LEAST_VARIANCE = 1e-3
"""Of the logarithm of a step's hours: what interpolation between diagnoses leaves open."""

PARTIAL = 0.15
"""Variance of that logarithm where half of a step is done."""

LEAST_PART = 0.1
"""Of a step that is taken to be done once it is begun: less is within the error of a diagnosis."""

FIRST_PART = 0.4
"""Of the first step, below which what was gone says nothing of its pace: it may not have set in."""


class Passages(NamedTuple):
    """What is known of the pace of a component, or of several: any one shape (…), D being that of `SHARES`.

    Attributes
    ----------
    slowness
        y_j, logarithms of the hours of ageing [h] in which each step is gone, (…, D); 0 where not known.
    precision
        Inverse variances of these, (…, D); 0 where not known.
    waited
        Logarithm of the hours of ageing that the first step has taken at least; -inf where it is passed.
    passed
        Number of shares passed.
    share
        Of the way gone.
    part
        Of the present step that is gone.
    """

    slowness: Array
    precision: Array
    waited: Array
    passed: Array
    share: Array
    part: Array

    @classmethod
    def of(cls, age: Array, share: Array, least: float = LEAST_HOURS) -> "Passages":
        """Return what one component shows that was at `share` (n,) of its way at increasing `age` (n,) [h].

        It was new, at share 0, at age 0. No step is taken to be shorter than `least` [h]. Diagnoses err, wear
        does not heal: shares are replaced by the increasing sequence nearest to them (isotonic regression
        [1]); between them the way is straight. Of a step of which the part f is gone in h hours, ln(h / f) is
        known with variance 0.15 (1 - f) / f.

        References
        ----------
        [1] Barlow, Bartholomew, Bremner, Brunk: Statistical Inference under Order Restrictions (1972).
        """
        from scipy.optimize import isotonic_regression

        ages = np.concatenate([[0.0], age])
        way = isotonic_regression(np.concatenate([[0.0], share])).x
        passed = int(np.searchsorted(SHARES, way.max() + 1e-12, "right"))
        at = np.array([_passage(ages, way, one) for one in SHARES[:passed]])
        slowness, precision = np.zeros(SHARES.size), np.zeros(SHARES.size)
        slowness[:passed] = np.log(np.maximum(np.diff(at, prepend=0.0), least))
        precision[:passed] = 1 / LEAST_VARIANCE
        waited, part = -np.inf, 0.0
        if passed < SHARES.size:
            start = SHARES[passed - 1] if passed else 0.0
            part = float(np.clip((way[-1] - start) / (SHARES[passed] - start), 0.0, 0.999))
            hours = float(ages[-1] - (at[-1] if passed else 0.0))
            if not passed:
                waited = float(np.log(max(hours, LEAST_WAIT * least)))
            if (part > FIRST_PART and hours > 0) if not passed else hours > least:
                gone = max(part, LEAST_PART)
                slowness[passed] = np.log(hours / gone)
                precision[passed] = 1 / (LEAST_VARIANCE + PARTIAL * (1 - gone) / gone)
        numbers = (np.asarray(x, float) for x in (waited, passed, way[-1], part))
        return cls(slowness, precision, *numbers)

    def waiting(self, age: float, least: float = LEAST_HOURS) -> "Passages":
        """Return the passages of one component at `age` [h]: if it waits, it has waited up to then."""
        if self.passed:
            return self
        return self._replace(waited=np.asarray(np.log(max(age, LEAST_WAIT * least))))

    @classmethod
    def stacked(cls, each: "Sequence[Passages]") -> "Passages":
        """Return several of the same shape, one or more, with an axis more, the first."""
        return cls(*(np.stack(column) for column in zip(*each, strict=True)))


def least_hours(lives: "Sequence[float]") -> float:
    """Return the least hours of a step [h] of components that were seen for the hours `lives` [h]."""
    return min(LEAST_HOURS, LEAST_SHARE * float(np.median(lives))) if lives else LEAST_HOURS


def _passage(age: Array, way: Array, share: float) -> float:
    """Return the age [h] at which a `way` that does not fall is first at `share`, which it reaches."""
    after = int(np.searchsorted(way, share - 1e-12, "left"))
    if after == 0:
        return float(age[0])
    done = (share - way[after - 1]) / (way[after] - way[after - 1])
    return float(age[after - 1] + done * (age[after] - age[after - 1]))
