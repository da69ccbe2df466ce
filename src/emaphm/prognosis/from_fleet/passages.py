"""Passages of a component through the steps of its margin, estimated from its diagnoses."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from emaphm.arrays import Array

if TYPE_CHECKING:
    from collections.abc import Sequence

SHARES = np.linspace(0.1, 1.0, 10)
"""Consumed shares of the margin at the ends of the steps: the first is above the differences between new
components; the steps are equal, and each takes several check flights."""

LEAST_HOURS, LEAST_SHARE = 5.0, 0.01
"""Least hours of a step [h], or as a share of the fleet's median life if that is less: a jump may pass
several steps at once."""

LEAST_WAIT = 0.2
"""Least wait before the first passage, as a share of the least hours of a step."""

LEAST_VARIANCE = 1e-3
"""Variance of the logarithm of a step's hours, from the interpolation between diagnoses."""

PARTIAL = 0.15
"""Variance of this logarithm if half of a step is done."""

LEAST_PART = 0.1
"""Least share of the present step that is assumed to be done: less is within the error of a diagnosis."""

FIRST_PART = 0.4
"""Share of the first step below which it is not used for the pace: degradation may not have started."""


class Passages(NamedTuple):
    """Known passages of one or several components: any shape (…), and D steps, see `SHARES`.

    Attributes
    ----------
    log_hours
        y_j, logarithms of the hours of ageing [h] of each step, (…, D); 0 if unknown.
    precision
        Inverse variances of `log_hours`, (…, D); 0 if unknown.
    waited
        Logarithm of the least hours of ageing [h] of the first step; -inf if it is passed.
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
        """Return the passages of a component with consumed shares `share` (n,) at increasing `age` (n,) [h].

        At age 0 it is new, with share 0. No step is shorter than `least` [h]. Diagnoses have errors, but
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
        passage_age = np.array([_passage(ages, path, value) for value in SHARES[:passed]])
        log_hours, precision = np.zeros(SHARES.size), np.zeros(SHARES.size)
        log_hours[:passed] = np.log(np.maximum(np.diff(passage_age, prepend=0.0), least))
        precision[:passed] = 1 / LEAST_VARIANCE
        waited, part = -np.inf, 0.0
        if passed < SHARES.size:
            start = SHARES[passed - 1] if passed else 0.0
            part = float(np.clip((path[-1] - start) / (SHARES[passed] - start), 0.0, 0.999))
            hours = float(ages[-1] - (passage_age[-1] if passed else 0.0))
            if not passed:
                waited = float(np.log(max(hours, LEAST_WAIT * least)))
            if (part > FIRST_PART and hours > 0) if not passed else hours > least:
                done = max(part, LEAST_PART)
                log_hours[passed] = np.log(hours / done)
                precision[passed] = 1 / (LEAST_VARIANCE + PARTIAL * (1 - done) / done)
        numbers = (np.asarray(x, float) for x in (waited, passed, path[-1], part))
        return cls(log_hours, precision, *numbers)

    def waiting_until(self, age: float, least: float) -> "Passages":
        """Return the passages of one component at `age` [h]; without a passage, its wait is set to `age`.

        No step is shorter than `least` [h].
        """
        if self.passed:
            return self
        return self._replace(waited=np.asarray(np.log(max(age, LEAST_WAIT * least))))

    @classmethod
    def stacked(cls, each: "Sequence[Passages]") -> "Passages":
        """Return one or more passages of the same shape, stacked along a new first axis."""
        return cls(*(np.stack(column) for column in zip(*each, strict=True)))


def least_hours(lives: "Sequence[float]") -> float:
    """Return the least hours of a step [h] of components with observed lives of `lives` [h]."""
    return min(LEAST_HOURS, LEAST_SHARE * float(np.median(lives))) if lives else LEAST_HOURS


def _passage(age: Array, path: Array, share: float) -> float:
    """Return the age [h] at which a nondecreasing `path` first reaches `share`."""
    after = int(np.searchsorted(path, share - 1e-12, "left"))
    if after == 0:
        return float(age[0])
    done = (share - path[after - 1]) / (path[after] - path[after - 1])
    return float(age[after - 1] + done * (age[after] - age[after - 1]))
