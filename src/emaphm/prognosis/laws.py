"""Laws of degradation: transition of the level and rate of a component, given its law."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array
from emaphm.prognosis.columns import ECCENTRICITY
from emaphm.prognosis.from_fleet.reference_trajectories import ReferenceTrajectories
from emaphm.prognosis.settings import (
    AS_ANOTHER,
    CHANGING_RATE,
    CONSTANT,
    CRACK_GROWTH,
    EXPONENTIAL,
    POWER_LAW,
    SUDDEN_ONSET,
    DegradationSettings,
)

LARGEST_EXPONENT = 7.0
"""Largest exponent of the exponential law in one step: growth by 1,000 takes any level out of its bounds."""

LEAST_LEFT = 1e-3
"""Smallest remaining share of a growing crack's life scale: from there, it leaves its bounds in one step."""

SOON_INFINITE = 1e-200
"""Remaining time [h] of a crack that becomes infinite within a step: no life divided by it overflows."""

Numbers = NDArray[np.int8]

AnyArray = TypeVar("AnyArray", bound=NDArray[Any])

Mask = NDArray[np.bool_]
"""Boolean array; its shape is given where it is used."""


def has_plane(components: int) -> bool:
    """Return whether the eccentricity's two coordinates are among the first `components`."""
    return components > max(ECCENTRICITY)


def in_common(values: AnyArray) -> AnyArray:
    """Return `values` (n, components, …) with those of the eccentricity's x coordinate copied to its y."""
    if not has_plane(values.shape[1]):
        return values
    result = values.copy()
    result[:, ECCENTRICITY[1]] = values[:, ECCENTRICITY[0]]
    return result


def transition(
    law: Numbers,
    life_scale: Array,
    shape: Array,
    age: Array,
    hours: Array | float,
    settings: DegradationSettings,
    trajectories: ReferenceTrajectories | None = None,
) -> tuple[Array, Array]:
    """Return the coefficients d [h] and g [-] of the transition over `hours`, each of the shape of `law`.

    Given the law, the transition of level x [-] and rate v = dx/dt [1/h] is linear:

        x⁺ = x + d v,    v⁺ = g v

        constant, sudden onset before its onset    d = 0                        g = 1
        linear, sudden onset after it              d = h                        g = 1
        exponential, time constant τ = s T         d = τ (exp(h/τ) - 1)         g = exp(h/τ)
        power law, x - x_0 ∝ a^p                   d = a/p (((a+h)/a)^p - 1)    g = ((a+h)/a)^(p-1)
        crack growth, infinite at a = T            d = r/q ((r/(r-h))^q - 1)    g = (r/(r-h))^(q+1)
        as another unit, whose level moved by L    d = T (L((a+h)/T) - L(a/T))  g = 1

    With a negative v the level falls. A crack grows by dx/dt ∝ (x - x_c)^m with an unknown initial level x_c:
    q = 1/(m - 1), and r = T - a is the time until it is infinite. L is a function of the share of the other
    unit's span, so that T is the time in which this unit follows the same trajectory; v = 1/T follows it to
    the same level. A component of sudden onset has v = 0 before its onset.

    Parameters
    ----------
    law
        Numbers of `LAWS`, any shape.
    life_scale
        T [h].
    shape
        s of the exponential law, p of the power law, q of crack growth, number of the other unit; unused by
        the remaining laws.
    age
        a, hours since the component was new [h].
    hours
        h, the step [h].
    trajectories
        Trajectories of other units, needed if any law is `AS_ANOTHER`; the shape is then (…, 8).

    Returns
    -------
    d [h], g [-].
    """
    h, age = np.broadcast_to(hours, law.shape), np.broadcast_to(age, law.shape)
    arguments = law.ravel(), h.ravel(), age.ravel(), life_scale.ravel(), shape.ravel()
    reach, growth = np.where(law == CONSTANT, 0.0, h).ravel(), np.ones(law.size)

    def rows_and_arguments(number_of_law: int) -> tuple[NDArray[np.intp], list[Array]]:
        rows = np.flatnonzero(arguments[0] == number_of_law)
        return rows, [values[rows] for values in arguments[1:]]

    rows, (step, _, scale, s) = rows_and_arguments(EXPONENTIAL)
    if rows.size:
        tau = s * scale
        exponent = np.minimum(step / tau, LARGEST_EXPONENT)
        reach[rows], growth[rows] = tau * np.expm1(exponent), np.exp(exponent)
    rows, (step, a, _, p) = rows_and_arguments(POWER_LAW)
    if rows.size:
        a = np.maximum(a, settings.first_hours)
        ratio = (a + step) / a
        reach[rows], growth[rows] = a / p * (ratio**p - 1), ratio ** (p - 1)
    rows, (step, a, scale, q) = rows_and_arguments(CRACK_GROWTH)
    if rows.size:
        remaining = np.maximum(scale - a, LEAST_LEFT * scale)
        end = np.maximum(remaining - step, SOON_INFINITE)
        ratio = np.minimum(remaining / end, np.exp(LARGEST_EXPONENT / (q + 1)))
        reach[rows], growth[rows] = remaining / q * (ratio**q - 1), ratio ** (q + 1)
    if trajectories is not None:
        rows, (step, a, scale, number) = rows_and_arguments(AS_ANOTHER)
        column, unit = rows % law.shape[-1], number.astype(int)
        end = trajectories.change_at(unit, (a + step) / scale, column)
        reach[rows] = scale * (end - trajectories.change_at(unit, a / scale, column))
    return reach.reshape(law.shape), growth.reshape(law.shape)


def is_moving(law: Numbers) -> Mask:
    """Return a mask of the components whose law has a rate, of the shape of `law`."""
    return np.asarray((law != CONSTANT) & (law != SUDDEN_ONSET))


def is_waiting(law: Numbers) -> Mask:
    """Return a mask of the components with a sudden onset that has not occurred yet."""
    return np.asarray(law == SUDDEN_ONSET)


def keeps_rate(before: Numbers, after: Numbers) -> Mask:
    """Return a mask of the components that keep their rate when their law changes, of the shape of the laws.

    Both laws must have a rate of the component itself: along the trajectory of another unit, it is a pace.
    """
    return np.asarray(is_moving(before) & (before != AS_ANOTHER) & is_moving(after))


def rate_scale(
    law: Numbers, life_scale: Array, shape: Array, age: Array, settings: DegradationSettings
) -> Array:
    """Return the standard deviation of an unknown rate [1/h]: the rate that changes the level by 1 within T.

    It is 0 for the laws without a rate: constant, and sudden onset before its onset. Parameters
    and shapes as in `transition`.
    """
    reach, _ = transition(law, life_scale, shape, age, life_scale, settings)
    return np.where(is_moving(law), 1 / np.maximum(reach, life_scale * 1e-3), 0.0)


def onsets(law: Numbers, life_scale: Array, hours: Array, random: np.random.Generator) -> Mask:
    """Return a mask (n, components) of the sudden onsets within `hours` [h], of probability 1 - exp(-h/T).

    Parameters and shapes are those of `transition`.
    """
    return is_waiting(law) & (in_common(random.random(law.shape)) < -np.expm1(-hours / life_scale))


def breaks(
    law: Numbers,
    life_scale: Array,
    hours: Array | float,
    settings: DegradationSettings,
    random: np.random.Generator,
) -> Array:
    """Return the factors of the rates for breaks within `hours` [h], (n, components): 1 without a break.

    A nonzero rate breaks with probability 1 - exp(-b h/T), by a log-normal factor. The trajectory of another
    unit contains the breaks of that unit, and gets no others. Parameters and shapes are those of
    `transition`.
    """
    has_own_rate = is_moving(law) & (law != AS_ANOTHER)
    happens = in_common(random.random(law.shape)) < -np.expm1(-settings.breaks * hours / life_scale)
    rows = np.flatnonzero(happens.any(axis=1))
    factor = np.ones(law.shape)
    shock = in_common(random.standard_normal((rows.size, law.shape[1])))
    factor[rows] = np.where((has_own_rate & happens)[rows], np.exp(settings.break_factor * shock), 1.0)
    return factor


def noises(
    law: Numbers, life_scale: Array, roughness: Array, hours: Array | float, settings: DegradationSettings
) -> tuple[Array, Array, Array]:
    """Return the process noise over `hours`: variance of the level, covariance, variance of the rate.

    The level deviates from its law by a Wiener process with variance q² = ρ²/T per hour, multiplied by
    `quiet`² for laws without a rate. The rate of the law "changing rate" has a Wiener process with variance
    r² = (ϱ/T)²/T per hour, which the level integrates:

        Q = [[q² h + r² h³/3, r² h²/2], [., r² h]]

    ρ and ϱ are `noise` and `rate_noise` of the settings times the component's `roughness` [-]. Other
    parameters and shapes are those of `transition`.

    Returns
    -------
    Variance of the level [-], covariance [1/h], variance of the rate [1/h²].
    """
    h = np.asarray(hours, float)
    q, r = noise_rates(law, life_scale, roughness, settings)
    return q * h + r * h**3 / 3, r * h**2 / 2, r * h


def noise_rates(
    law: Numbers, life_scale: Array, roughness: Array, settings: DegradationSettings
) -> tuple[Array, Array]:
    """Return q² [1/h] and r² [1/h³] of `noises`, the variances of level and rate per hour."""
    q = np.where(is_moving(law), 1.0, settings.quiet**2) * (roughness * settings.noise) ** 2 / life_scale
    wanders = law == CHANGING_RATE
    r = np.where(wanders, (roughness * settings.rate_noise / life_scale) ** 2 / life_scale, 0.0)
    return q, r
