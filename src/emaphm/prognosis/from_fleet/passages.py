"""When a component passes steps of its margin: what its diagnoses say about its pace."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from emaphm.arrays import Array

if TYPE_CHECKING:
    from collections.abc import Sequence

SHARES = np.linspace(0.1, 1.0, 10)
"""Consumed shares of the margin whose passage times are taken: the first is above the differences between new
components; then even steps, each some check flights long."""

LEAST_HOURS, LEAST_SHARE = 5.0, 0.01
"""Least hours of a step [h], or as a share of the fleet's median life if that is less: a jump may pass
several steps at once."""

LEAST_WAIT = 0.2
"""Least wait before the first passage, as a share of the least hours of a step."""

LEAST_VARIANCE = 1e-3
"""Variance of the logarithm of a step's hours, from the interpolation between diagnoses."""

PARTIAL = 0.15
"""Variance of that logarithm if half of a step is done."""

LEAST_PART = 0.1
"""Least share of the present step that counts as done: less is within the error of a diagnosis."""

FIRST_PART = 0.4
"""Share of the first step below which it says nothing about the pace: degradation may not have set in."""


class Passages(NamedTuple):
    """What is known of the pace of a component, or of several: any one shape (…), and D steps, see `SHARES`.

    Attributes
    ----------
    log_hours
        y_j, logarithms of the hours of ageing [h] in which each step is passed, (…, D); 0 where not known.
    precision
        Inverse variances of these, (…, D); 0 where not known.
    waited
        Logarithm of the least hours of ageing [h] of the first step; -inf where it is passed.
    passed
        Number of shares passed.
    share
        Consumed share of the margin.
    part
        Share of the present step that is done.
    """

    log_hours: Array
    precision: Array
    waited: Array
    passed: Array
    share: Array
    part: Array

    @classmethod
    def of(cls, age: Array, share: Array, least: float = LEAST_HOURS) -> "Passages":
        """Return the passages of one component with consumed shares `share` (n,) at rising `age` (n,) [h].

        At age 0 it was new, with share 0. No step is shorter than `least` [h]. Diagnoses have errors, but
        wear does not heal: the shares are replaced by the nearest increasing sequence (isotonic regression
        [1]), with straight lines between them. If the part f of the present step took h hours, the logarithm
        of its hours is ln(h / f), with variance 0.15 (1 - f) / f.

        References
        ----------
        [1] Barlow, Bartholomew, Bremner, Brunk: Statistical Inference under Order Restrictions (1972).
        """
        from scipy.optimize import isotonic_regression

        ages = np.concatenate([[0.0], age])
        path = isotonic_regression(np.concatenate([[0.0], share])).x
        passed = int(np.searchsorted(SHARES, path.max() + 1e-12, "right"))
        at = np.array([_passage(ages, path, one) for one in SHARES[:passed]])
        log_hours, precision = np.zeros(SHARES.size), np.zeros(SHARES.size)
        log_hours[:passed] = np.log(np.maximum(np.diff(at, prepend=0.0), least))
        precision[:passed] = 1 / LEAST_VARIANCE
        waited, part = -np.inf, 0.0
        if passed < SHARES.size:
            start = SHARES[passed - 1] if passed else 0.0
            part = float(np.clip((path[-1] - start) / (SHARES[passed] - start), 0.0, 0.999))
            hours = float(ages[-1] - (at[-1] if passed else 0.0))
            if not passed:
                waited = float(np.log(max(hours, LEAST_WAIT * least)))
            if (part > FIRST_PART and hours > 0) if not passed else hours > least:
                done = max(part, LEAST_PART)
                log_hours[passed] = np.log(hours / done)
                precision[passed] = 1 / (LEAST_VARIANCE + PARTIAL * (1 - done) / done)
        numbers = (np.asarray(x, float) for x in (waited, passed, path[-1], part))
        return cls(log_hours, precision, *numbers)

    def waiting_until(self, age: float, least: float) -> "Passages":
        """Return the passages of one component at `age` [h]; without any it has waited until then.

        No step is shorter than `least` [h].
        """
        if self.passed:
            return self
        return self._replace(waited=np.asarray(np.log(max(age, LEAST_WAIT * least))))

    @classmethod
    def stacked(cls, each: "Sequence[Passages]") -> "Passages":
        """Return several of the same shape, one or more, with an axis more, the first."""
        return cls(*(np.stack(column) for column in zip(*each, strict=True)))


def least_hours(lives: "Sequence[float]") -> float:
    """Return the least hours of a step [h] of components that were followed for the hours `lives` [h]."""
    return min(LEAST_HOURS, LEAST_SHARE * float(np.median(lives))) if lives else LEAST_HOURS


def _passage(age: Array, path: Array, share: float) -> float:
    """Return the age [h] at which a `path` that does not fall first reaches `share`."""
    after = int(np.searchsorted(path, share - 1e-12, "left"))
    if after == 0:
        return float(age[0])
    done = (share - path[after - 1]) / (path[after] - path[after - 1])
    return float(age[after - 1] + done * (age[after] - age[after - 1]))
