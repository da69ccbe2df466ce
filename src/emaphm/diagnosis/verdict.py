"""From an estimate and its covariance to a statement about each fault component."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from emaphm.actuator import NAMES
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import PRIOR_DEVIATION, SHORTS, ParameterSpace
from emaphm.estimation.uncertainty.collinearity import CollinearSet

Verdict = Literal["healthy", "degraded", "cannot tell"]

Z95 = 1.959963984540054
"""Half-width of a normal 95 % interval, in standard errors."""

R95 = (-2 * math.log(0.05)) ** 0.5
"""The same of the distance from 0 of two independent normal errors, in standard errors (Rayleigh)."""

DIRECTIONS = 720
"""Number of directions in which the distance of an ellipse from 0 is taken."""


@dataclass(frozen=True)
class VerdictSettings:
    """From which values a component is called degraded, healthy, or not identifiable, in its unit [0, 1].

    Degraded: the whole interval is more than `healthy_margin` away from the healthy value; no model is right
    to a hundredth of the range. Healthy: no value in the interval is more than `hidden_fault` away from it.
    Not identifiable: the interval is longer than `longest_interval`, half the range. Where only the bounds of
    the range make it shorter, the verdict is open. A standard error above `uninformative` times the prior's
    leaves the whole range open. Shorts that differ by less than `equal_shorts` are
    equal. `make study` (accuracy) counts false alarms and detections.
    """

    healthy_margin: float = 0.02
    hidden_fault: float = 0.1
    longest_interval: float = 0.5
    uninformative: float = 0.7
    equal_shorts: float = 0.01


VERDICT = VerdictSettings()


COMMON_SHORTS = (
    "all three windings seem to have lost the same share: a weaker magnet, or a wrong torque constant, "
    "temperature or scale of the current would look alike"
)
UNCONSTRAINED = "this recording does not constrain it; a larger or faster command would"
BOTH = "its interval contains both the healthy value and relevant faults"
OF_MODEL_ERROR = (
    "in recordings left out of the calibration the model's error looked like this; calibrate on more "
    "manoeuvres, or with the law it lacks (--laws)"
)
NOT_EXPLAINED = "no model of this actuator explains the recording, so what causes its residual is not known"


@dataclass(frozen=True)
class Estimate:
    """One fault component: its normalised value, standard error, 95 % interval and verdict.

    The verdict is "degraded" where the whole interval is away from the healthy value, "healthy" where it
    leaves room for no fault that matters, else "cannot tell". `identifiable` is false where the interval
    covers more than half of the range: the value is then not known, whatever the verdict. `reason` says why
    a verdict or a value is missing. The interval of the eccentricity's phase may run past 0 or 1, where the
    circle closes. `limits` are the least and the largest value that the component may have.
    """

    value: float
    standard_error: float
    interval95: tuple[float, float]
    identifiable: bool
    verdict: Verdict
    reason: str = ""
    limits: tuple[float, float] = (0.0, 1.0)

    @property
    def unconstrained(self) -> bool:
        """Whether the interval is all of the range: the recording says nothing of the component."""
        return self.interval95 == self.limits


def estimates(
    space: ParameterSpace, point: Array, covariance: Array, collinear_sets: Sequence[CollinearSet] = ()
) -> dict[str, Estimate]:
    """Return the eight components at `point` (d,) with intervals from `covariance` (d, d).

    Where a component is not identifiable, its reason names the `collinear_sets` that it is a member of.
    """
    faults = space.faults(point)
    result = {}
    for i, name in enumerate(NAMES):
        if name in space.fixed:
            result[name] = _unknown(float(HEALTHY.vector[i]), PRIOR_DEVIATION, (0.0, 1.0), space.fixed[name])
        elif name not in ("eccentricity", "eccentricity_phase"):
            column = space.columns.index(i)
            error = float(np.sqrt(covariance[column, column]))
            collinear = _collinear_with(name, collinear_sets)
            healthy, limits = float(HEALTHY.vector[i]), space.limits(name)
            result[name] = _component(float(faults[i]), error, healthy, collinear, limits)
    if "eccentricity" not in space.fixed:
        collinear = _collinear_with("eccentricity", collinear_sets)
        result |= _eccentricity(space, point, covariance, collinear)
    return {name: result[name] for name in NAMES} | _common_shorts(result)


def _common_shorts(components: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Return the shorts, undecided, where all three windings have lost the same share of their turns.

    That is where all are degraded, and the two smaller ones equal within their errors. It would be a
    coincidence of three faults; a weaker magnet, a wrong torque constant or temperature, and a wrong scale of
    the current lower the flux of all three windings.
    """
    shorts = {name: components[name] for name in SHORTS}
    if any(short.verdict != "degraded" for short in shorts.values()):
        return {}
    least, next_to = sorted(shorts.values(), key=lambda short: short.value)[:2]
    error = Z95 * float(np.hypot(least.standard_error, next_to.standard_error))
    if next_to.value - least.value > max(error, VERDICT.equal_shorts):
        return {}
    return {
        name: replace(short, verdict="cannot tell", reason=COMMON_SHORTS) for name, short in shorts.items()
    }


def undecided(name: str, estimate: Estimate, reason: str) -> Estimate:
    """Return the estimate as undecided for a `reason`, its interval widened to hold the healthy value."""
    healthy = float(getattr(HEALTHY, name))
    low, high = estimate.interval95
    interval = (min(low, healthy), max(high, healthy))
    return replace(estimate, verdict="cannot tell", interval95=interval, reason=reason)


def with_phase_undecided(
    components: Mapping[str, Estimate], before: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Return the components, the phase undecided too where the eccentricity is and was not `before`."""
    size = components["eccentricity"]
    if size.verdict != "cannot tell" or before["eccentricity"].verdict != "degraded":
        return dict(components)
    phase = replace(components["eccentricity_phase"], verdict="cannot tell", reason=size.reason)
    return {**components, "eccentricity_phase": phase}


def undecided_by_model_error(
    components: Mapping[str, Estimate], share: Array, space: ParameterSpace
) -> dict[str, Estimate]:
    """Return the components, with another reason where one is undecided mostly for the learned model error.

    `share` (d,) is the model error's share of the variance of each coordinate of `space`.
    """
    named = dict(components)
    for name, estimate in components.items():
        at = [i for i, coordinate in enumerate(space.coordinates) if coordinate in (name, f"{name}_x")]
        if at and estimate.reason in (UNCONSTRAINED, BOTH) and share[at[0]] > 1 / 2:
            named[name] = replace(estimate, reason=OF_MODEL_ERROR)
    return named


def unexplained(components: Mapping[str, Estimate], fixed: Collection[str] = ()) -> dict[str, Estimate]:
    """Return the components of a recording that is not explained: none is called healthy or degraded.

    Those that are `fixed`, which were not estimated, keep their own reason.
    """
    return {
        name: replace(
            estimate, verdict="cannot tell", reason=estimate.reason if name in fixed else NOT_EXPLAINED
        )
        for name, estimate in components.items()
    }


def _collinear_with(name: str, collinear_sets: Sequence[CollinearSet]) -> str:
    """Return why a member of a collinear set is not identifiable, nothing for another component."""
    others = [group.others(name) for group in collinear_sets if name in group.members]
    return f"only its combined effect with {others[0]} is identifiable" if others else ""


def _unknown(value: float, error: float, limits: tuple[float, float], reason: str) -> Estimate:
    return Estimate(
        value, error, limits, identifiable=False, verdict="cannot tell", reason=reason, limits=limits
    )


def _component(
    value: float,
    error: float,
    healthy: float,
    collinear: str = "",
    limits: tuple[float, float] = (0.0, 1.0),
    ends: tuple[float, float] | None = None,
) -> Estimate:
    """Return the estimate of a component, with the verdict that its interval allows.

    The interval's `ends` are `Z95` standard errors from the `value` where they are not given.
    """
    unconstrained = collinear or UNCONSTRAINED
    if error > VERDICT.uninformative * PRIOR_DEVIATION:
        # A search may have ended anywhere in the range: so may the interval be.
        return _unknown(value, error, limits, unconstrained)
    least, most = limits
    below, above = ends or (value - Z95 * error, value + Z95 * error)
    low, high = interval = (max(below, least), min(above, most))
    if 2 * Z95 * error > VERDICT.longest_interval and high - low < 2 * Z95 * error:
        # Only the bound of the range makes it shorter: the search may have ended there for whatever reason.
        return Estimate(value, error, interval, False, "cannot tell", unconstrained, limits)
    identifiable = high - low <= VERDICT.longest_interval
    verdict = verdict_of((low, high), healthy)
    reason = ""
    if verdict == "cannot tell":
        reason = collinear or (BOTH if identifiable else UNCONSTRAINED)
    elif not identifiable:
        reason = "its size may be anywhere in the interval"
    return Estimate(value, error, interval, identifiable, verdict, reason, limits)


def verdict_of(interval: tuple[float, float], healthy: float) -> Verdict:
    """Return the verdict on a component by its 95 % `interval` and its `healthy` value."""
    low, high = interval
    if max(low - healthy, healthy - high) > VERDICT.healthy_margin:
        return "degraded"
    if max(high - healthy, healthy - low) <= VERDICT.hidden_fault:
        return "healthy"
    return "cannot tell"


def _eccentricity(
    space: ParameterSpace, point: Array, covariance: Array, collinear: str
) -> Mapping[str, Estimate]:
    """Return radius and phase from Cartesian form; the phase only where the eccentricity is degraded."""
    x = space.columns.index(5)
    faults = space.faults(point)
    block = covariance[x : x + 2, x : x + 2]
    radius = float(faults[5])
    phase = float(faults[6])
    along = point[x : x + 2] / radius if radius > 0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    radial = float(np.sqrt(along @ block @ along))
    turning = float(np.sqrt(across @ block @ across)) / (2 * np.pi * max(radius, 1e-12))
    half = Z95 * turning
    ends = _distances(point[x : x + 2], block)
    error = max(radial, (ends[1] - ends[0]) / (2 * Z95))
    size = _component(radius, error, healthy=0.0, collinear=collinear, ends=ends)
    if size.verdict != "degraded" or 2 * half > VERDICT.longest_interval:
        reason = "no significant eccentricity, so its direction is undefined"
        if size.verdict == "degraded":
            reason = "the recording shows the eccentricity, and not its direction"
        angle = _unknown(phase, min(turning, float(PRIOR_DEVIATION)), (0.0, 1.0), reason)
    else:
        # A direction is neither good nor bad: it shares the verdict of the eccentricity itself.
        interval = (phase - half, phase + half)
        angle = Estimate(phase, turning, interval, identifiable=True, verdict=size.verdict)
    return {"eccentricity": size, "eccentricity_phase": angle}


def _distances(centre: Array, covariance: Array) -> tuple[float, float]:
    """Return the least and the largest distance from 0 of an ellipse about `centre` (2,), `Z95` errors out.

    An unknown direction makes a radius uncertain too, which its radial error does not show: an estimate of
    0.01 that is known to 0.001 along itself and to 0.2 across may have a radius of 0.4.

    At 0 no direction can be chosen to fit, so both coordinates err: 0 is outside only where the estimate is
    `R95` errors from it. By `Z95`, 15 % of the recordings of a centred rotor would have it outside.
    """
    values, axes = np.linalg.eigh(covariance)
    reach = Z95 * np.sqrt(np.maximum(values, 0.0))
    angles = np.linspace(0.0, 2 * np.pi, DIRECTIONS, endpoint=False)
    rim = centre[:, np.newaxis] + axes @ (reach[:, np.newaxis] * np.stack([np.cos(angles), np.sin(angles)]))
    distances = np.hypot(*rim)
    (u, v), (a, b) = (axes.T @ centre) ** 2, reach**2
    may_be_zero = u * b + v * a < a * b * (R95 / Z95) ** 2
    return (0.0 if may_be_zero else float(distances.min())), float(distances.max())
