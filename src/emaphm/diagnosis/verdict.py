"""Intervals and verdicts of the fault components, from an estimate and its covariance."""

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
"""95 % quantile of the distance from 0 of two independent normal errors, in standard errors (Rayleigh)."""

DIRECTIONS = 720
"""Number of directions in which the distance of an ellipse from 0 is computed."""


@dataclass(frozen=True)
class VerdictSettings:
    """Limits of the verdicts, in the unit [0, 1] of a component.

    Degraded: the whole interval is more than `healthy_margin` from the healthy value; no model is accurate
    to a hundredth of the range. Healthy: no value in the interval is more than `hidden_fault` from it. Not
    identifiable: the interval is longer than `longest_interval`, half the range. An interval that is shorter
    only because of the bounds of the range gives no verdict. With a standard error above `uninformative`
    times that of the prior, the interval is the whole range. Shorts that differ by less than `equal_shorts`
    are equal. `make study` (accuracy) counts false alarms and detections.
    """

    healthy_margin: float = 0.02
    hidden_fault: float = 0.1
    longest_interval: float = 0.5
    uninformative: float = 0.7
    equal_shorts: float = 0.01


VERDICT = VerdictSettings()


COMMON_SHORTS = (
    "all three windings seem to have lost the same share: a weaker magnet, or a wrong torque constant, "
    "temperature or scale of the current would have the same effect"
)
UNCONSTRAINED = "this recording does not constrain it; a larger or faster command would"
BOTH = "its interval contains both the healthy value and relevant faults"
OF_MODEL_ERROR = (
    "the model's error in healthy recordings has a similar effect; calibrate on more manoeuvres, or with the "
    "missing law (--laws)"
)
NOT_EXPLAINED = "no model of this actuator explains the recording, so the cause of its residual is not known"


@dataclass(frozen=True)
class Estimate:
    """One fault component: its normalised value, standard error, 95 % interval and verdict.

    The verdict is "degraded" if the whole interval is away from the healthy value, "healthy" if the interval
    contains no relevant fault, and "cannot tell" otherwise. `identifiable` is false if the interval covers
    more than half of the range: the value is then unknown, whatever the verdict. `reason` states why a
    verdict or a value is missing. The interval of the eccentricity's phase may extend beyond 0 or 1, because
    the phase is periodic. `limits` are the smallest and the largest possible value of the component.
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
        """Whether the interval is the whole range: the recording does not constrain the component."""
        return self.interval95 == self.limits


def estimates(
    space: ParameterSpace, point: Array, covariance: Array, collinear_sets: Sequence[CollinearSet] = ()
) -> dict[str, Estimate]:
    """Return the eight components at `point` (d,) with intervals from `covariance` (d, d).

    The reason of a component that is not identifiable names the members of its collinear set.
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
    """Return the shorts as undecided if all three windings have lost the same share of turns; else nothing.

    The condition is that all three are degraded, and the two smaller ones are equal within their errors.
    Three equal faults would be a coincidence; a weaker magnet, a wrong torque constant or temperature, or a
    wrong scale of the current has the same effect on all three windings.
    """
    shorts = {name: components[name] for name in SHORTS}
    if any(short.verdict != "degraded" for short in shorts.values()):
        return {}
    smallest, second = sorted(shorts.values(), key=lambda short: short.value)[:2]
    error = Z95 * float(np.hypot(smallest.standard_error, second.standard_error))
    if second.value - smallest.value > max(error, VERDICT.equal_shorts):
        return {}
    return {
        name: replace(short, verdict="cannot tell", reason=COMMON_SHORTS) for name, short in shorts.items()
    }


def undecided(name: str, estimate: Estimate, reason: str) -> Estimate:
    """Return the estimate as undecided, with its `reason`, and with the healthy value in its interval."""
    healthy = float(getattr(HEALTHY, name))
    low, high = estimate.interval95
    interval = (min(low, healthy), max(high, healthy))
    return replace(estimate, verdict="cannot tell", interval95=interval, reason=reason)


def with_phase_undecided(
    components: Mapping[str, Estimate], before: Mapping[str, Estimate]
) -> dict[str, Estimate]:
    """Return the components; the phase becomes undecided together with a formerly degraded eccentricity."""
    size = components["eccentricity"]
    if size.verdict != "cannot tell" or before["eccentricity"].verdict != "degraded":
        return dict(components)
    phase = replace(components["eccentricity_phase"], verdict="cannot tell", reason=size.reason)
    return {**components, "eccentricity_phase": phase}


def undecided_by_model_error(
    components: Mapping[str, Estimate], share: Array, space: ParameterSpace
) -> dict[str, Estimate]:
    """Return the components; the reason is the learned model error where it has most of the variance.

    `share` (d,) is the share of the model error in the variance of each coordinate of `space`.
    """
    named = dict(components)
    for name, estimate in components.items():
        columns = [i for i, coordinate in enumerate(space.coordinates) if coordinate in (name, f"{name}_x")]
        if columns and estimate.reason in (UNCONSTRAINED, BOTH) and share[columns[0]] > 1 / 2:
            named[name] = replace(estimate, reason=OF_MODEL_ERROR)
    return named


def unexplained(components: Mapping[str, Estimate], fixed: Collection[str] = ()) -> dict[str, Estimate]:
    """Return the components of a recording that is not explained: all are undecided.

    `fixed` components, which were not estimated, keep their reason.
    """
    return {
        name: replace(
            estimate, verdict="cannot tell", reason=estimate.reason if name in fixed else NOT_EXPLAINED
        )
        for name, estimate in components.items()
    }


def _collinear_with(name: str, collinear_sets: Sequence[CollinearSet]) -> str:
    """Return the reason of a member of a collinear set; empty for other components."""
    others = [group.others(name) for group in collinear_sets if name in group.members]
    return f"only its combined effect with {others[0]} is identifiable" if others else ""


def _unknown(value: float, error: float, limits: tuple[float, float], reason: str) -> Estimate:
    """Return an undecided estimate whose interval is the whole range."""
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
    """Return the estimate of a component with its verdict.

    The `ends` of the interval are by default `Z95` standard errors from the `value`.
    """
    unconstrained = collinear or UNCONSTRAINED
    if error > VERDICT.uninformative * PRIOR_DEVIATION:
        # The search may end anywhere in the range, so the interval is the whole range.
        return _unknown(value, error, limits, unconstrained)
    least, most = limits
    below, above = ends or (value - Z95 * error, value + Z95 * error)
    low, high = interval = (max(below, least), min(above, most))
    if 2 * Z95 * error > VERDICT.longest_interval and high - low < 2 * Z95 * error:
        # Only a bound of the range shortens the interval: the search may have stopped there for any reason.
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
    """Return the verdict on a component from its 95 % `interval` and its `healthy` value."""
    low, high = interval
    if distance_from(healthy, interval) > VERDICT.healthy_margin:
        return "degraded"
    if max(high - healthy, healthy - low) <= VERDICT.hidden_fault:
        return "healthy"
    return "cannot tell"


def distance_from(healthy: float, interval: tuple[float, float]) -> float:
    """Return the distance of an `interval` from the `healthy` value; negative if the interval contains it."""
    low, high = interval
    return max(low - healthy, healthy - high)


def _eccentricity(
    space: ParameterSpace, point: Array, covariance: Array, collinear: str
) -> Mapping[str, Estimate]:
    """Return radius and phase from the Cartesian form; the phase only if the eccentricity is degraded."""
    first = space.columns.index(5)
    faults = space.faults(point)
    block = covariance[first : first + 2, first : first + 2]
    radius = float(faults[5])
    phase = float(faults[6])
    radial_direction = point[first : first + 2] / radius if radius > 0 else np.array([1.0, 0.0])
    tangential_direction = np.array([-radial_direction[1], radial_direction[0]])
    radial_error = float(np.sqrt(radial_direction @ block @ radial_direction))
    phase_error = float(np.sqrt(tangential_direction @ block @ tangential_direction)) / (
        2 * np.pi * max(radius, 1e-12)
    )
    half_width = Z95 * phase_error
    ends = _distances(point[first : first + 2], block)
    error = max(radial_error, (ends[1] - ends[0]) / (2 * Z95))
    size = _component(radius, error, healthy=0.0, collinear=collinear, ends=ends)
    if size.verdict != "degraded" or 2 * half_width > VERDICT.longest_interval:
        reason = "no significant eccentricity, so its direction is undefined"
        if size.verdict == "degraded":
            reason = "the recording identifies the eccentricity, and not its direction"
        angle = _unknown(phase, min(phase_error, float(PRIOR_DEVIATION)), (0.0, 1.0), reason)
    else:
        # A direction is neither healthy nor degraded: it has the verdict of the eccentricity.
        interval = (phase - half_width, phase + half_width)
        angle = Estimate(phase, phase_error, interval, identifiable=True, verdict=size.verdict)
    return {"eccentricity": size, "eccentricity_phase": angle}


def _distances(centre: Array, covariance: Array) -> tuple[float, float]:
    """Return the smallest and largest distance from 0 of the ellipse of `Z95` errors about `centre` (2,).

    An unknown direction also makes the radius uncertain, which the radial error does not include: an estimate
    of 0.01 with an error of 0.001 in its direction and of 0.2 across it may have a radius of 0.4.

    The smallest distance is 0 unless the estimate is more than `R95` errors from 0, since both coordinates
    have errors there. With `Z95` instead, 15 % of the recordings of a centred rotor would exclude 0.
    """
    values, axes = np.linalg.eigh(covariance)
    reach = Z95 * np.sqrt(np.maximum(values, 0.0))
    angles = np.linspace(0.0, 2 * np.pi, DIRECTIONS, endpoint=False)
    rim = centre[:, np.newaxis] + axes @ (reach[:, np.newaxis] * np.stack([np.cos(angles), np.sin(angles)]))
    distances = np.hypot(*rim)
    (u, v), (a, b) = (axes.T @ centre) ** 2, reach**2
    may_be_zero = u * b + v * a < a * b * (R95 / Z95) ** 2
    return (0.0 if may_be_zero else float(distances.min())), float(distances.max())
