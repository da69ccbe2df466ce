"""Curves of the figures of a prognosis, in compact form for a history and a page."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from emaphm.actuator import COMPONENTS, NAMES
from emaphm.arrays import Array
from emaphm.prognosis.columns import columns_of, level_of
from emaphm.prognosis.requirements import vectors_of
from emaphm.prognosis.result import Prognosis
from emaphm.quantiles import sample_quantile

PROBABILITIES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Probabilities of the quantiles: bands of 90 and 50 %, and the median."""

MOST_SHOWN = 3.0
"""The forecast is shown up to this multiple of the horizon, or up to 1.2 times the median RUL if later."""

POINTS = 100
"""Points of the curve of the probability of failure."""

DIGITS = 4
"""Decimal digits of a stored number; a figure shows three."""

Z90 = 1.645
"""Half-width of a normal 90 % interval, in standard errors."""


@dataclass(frozen=True)
class Seen:
    """A diagnosis in a figure: flight `hours` [h], levels and half-widths of their 90 % intervals."""

    hours: float
    explained: bool
    levels: Mapping[str, float]
    halves: Mapping[str, float]


@dataclass(frozen=True)
class Curves:
    """The curves of a prognosis; hours are flight hours [h], levels normalised.

    Attributes
    ----------
    now, horizon, longest
        Flight hours at the prognosis, planned hours from then on, and longest RUL shown [h].
    seen
        The diagnoses.
    times, levels
        Flight hours (m,) of the forecast, and for each component the quantiles `PROBABILITIES` of its level,
        (m,) each.
    limits
        Component and bound of each limit on a level.
    risk_times, risk, first_risk, first_label
        Flight hours, and the probability that any requirement has failed until then; if there are several
        requirements, the same for the one that most likely fails first, and its name.
    fan
        Forecasts of the RUL: rows of flight hours and quantiles `PROBABILITIES` of the RUL [h].
    requirements
        Labels of the limits in the forecast.
    replacements
        Flight hours and component of each replacement, where "unit" means all components.
    """

    unit: str
    now: float
    horizon: float
    longest: float
    seen: tuple[Seen, ...]
    times: tuple[float, ...]
    levels: Mapping[str, tuple[tuple[float, ...], ...]]
    limits: tuple[tuple[str, float], ...]
    risk_times: tuple[float, ...]
    risk: tuple[float, ...]
    first_risk: tuple[float, ...]
    first_label: str
    fan: tuple[tuple[float, ...], ...]
    requirements: tuple[str, ...] = ()
    replacements: tuple[tuple[float, str], ...] = ()

    @classmethod
    def of(cls, prognosis: Prognosis, fan: Sequence[tuple[float, ...]] = ()) -> Self:
        """Return the curves of `prognosis`; `fan` are the rows of earlier forecasts."""
        forecast_paths, now = prognosis.paths, prognosis.evidence.hours
        duration = _reach(prognosis)
        shown = forecast_paths.hours <= duration
        vectors = vectors_of(forecast_paths.level[shown], prognosis.actuator)
        risk_times = np.linspace(0, duration, POINTS)
        first = _first_requirement_times(prognosis)
        return cls(
            unit=prognosis.evidence.unit,
            now=now,
            horizon=prognosis.horizon,
            longest=float(forecast_paths.hours[-1]),
            seen=tuple(
                Seen(
                    diagnosis.hours,
                    diagnosis.explained,
                    {name: _digits(level_of(diagnosis.level, name)) for name in COMPONENTS},
                    {
                        name: _digits(_half(diagnosis.covariance, diagnosis.level, name))
                        for name in COMPONENTS
                    },
                )
                for diagnosis in prognosis.evidence.observations
            ),
            times=_row(now + forecast_paths.hours[shown]),
            levels={
                name: tuple(
                    _row(values)
                    for values in np.quantile(vectors[:, :, NAMES.index(name)], PROBABILITIES, axis=1)
                )
                for name in COMPONENTS
            },
            limits=tuple(
                (limit.component, limit.bound)
                for limit in prognosis.times.limits
                if limit.component is not None
            ),
            risk_times=_row(now + risk_times),
            risk=_row(_share(prognosis.sample, risk_times)),
            first_risk=() if first is None else _row(_share(first, risk_times)),
            first_label=prognosis.limit.label if first is not None and prognosis.limit else "",
            fan=(*fan, fan_row(now, prognosis.sample, float(forecast_paths.hours[-1]))),
            requirements=tuple(limit.label for limit in prognosis.times.limits),
            replacements=prognosis.evidence.replacements,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the curves as JSON."""
        return {**asdict(self), "probabilities": list(PROBABILITIES)}

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> Self:
        """Return the curves from the JSON of `to_dict`."""
        values = {name: value for name, value in document.items() if name != "probabilities"}
        return cls(**values | {"seen": tuple(Seen(**diagnosis) for diagnosis in values["seen"])})


def fan_row(hours: float, sample: Array, longest: float) -> tuple[float, ...]:
    """Return a row of a fan: flight hours [h], and quantiles of a RUL `sample` (n,), up to `longest` [h]."""
    return hours, *(_digits(min(sample_quantile(sample, p), longest)) for p in PROBABILITIES)


def _reach(prognosis: Prognosis) -> float:
    """Return the duration of the forecast that is shown [h]."""
    median = prognosis.median if np.isfinite(prognosis.median) else 0.0
    longest = float(prognosis.paths.hours[-1])
    return min(max(MOST_SHOWN * prognosis.horizon, 1.2 * median), longest)


def _first_requirement_times(prognosis: Prognosis) -> Array | None:
    """Return the failure times of the requirement that most paths fail first; None if it is the only one."""
    if prognosis.limit is None or len(prognosis.times.limits) < 2:
        return None
    return np.asarray(prognosis.times.hours[prognosis.times.limits.index(prognosis.limit)])


def _share(sample: Array, times: Array) -> Array:
    return np.asarray(np.searchsorted(np.sort(sample), times, "right") / sample.size)


def _half(covariance: Array, level: Array, name: str) -> float:
    """Return the half-width of a component's 90 % interval from covariance (8, 8) and level (8,)."""
    columns = columns_of(name)
    direction = np.ones(1)
    if len(columns) > 1:
        direction = level[columns] / max(float(level_of(level, name)), 1e-12)
    variance = float(direction @ covariance[np.ix_(columns, columns)] @ direction)
    return min(Z90 * float(np.sqrt(max(variance, 0.0))), 1.0)


def _row(values: Array) -> tuple[float, ...]:
    return tuple(_digits(value) for value in values)


def _digits(value: Any) -> float:
    return round(float(value), DIGITS)
