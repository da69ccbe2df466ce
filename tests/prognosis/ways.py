"""Forecasts of the general prior for different shapes of degradation: `python -m tests.prognosis.ways`.

One component of one unit, without a fleet, degrades from healthy to its limit with one of twelve shapes. Some
shapes are no law of the filter: an onset of exponential wear, wear that saturates or slows down, steps.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.forecast import drawn_states, paths
from emaphm.prognosis.metrics import crps
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.requirements.first_passage import first_passage
from emaphm.prognosis.settings import FORECAST
from emaphm.random_streams import stream

LIMIT = 0.6
SHARES = (0.25, 0.5, 0.75, 0.9)
AGEING = np.linspace(0, 4, 4001)
PATHS = replace(FORECAST, paths=400, steps=80)
FEWEST = 3
"""Diagnoses before the first forecast."""

Shape = Callable[[Array, np.random.Generator], Array]


def _exponential(t: Array, rate: float) -> Array:
    return np.asarray(np.expm1(rate * np.minimum(t, 3)) / np.expm1(rate))


def _crack(t: Array, exponent: float, first: float) -> Array:
    """Return x - x_0 for dx/dt ~ x^m with x_0 = `first`; it becomes infinite in finite time."""
    e = 1 - exponent
    left = np.maximum(first**e + t * ((first + 1) ** e - first**e), 1e-9)
    return np.asarray(np.minimum(left ** (1 / e) - first, 5.0))


def _onset(t: Array, moment: float) -> Array:
    return np.asarray(np.maximum(t - moment, 0) / (1 - moment))


def _broken(t: Array, moment: float, factor: float) -> Array:
    level = t + (factor - 1) * np.maximum(t - moment, 0)
    return np.asarray(level / np.interp(1, t, level))


def _saturating(t: Array, rate: float) -> Array:
    return np.asarray(np.expm1(-rate * t) / np.expm1(-rate))


def _logistic(t: Array, steepness: float, middle: float) -> Array:
    """Return wear with its largest rate at `middle`."""
    start, level, end = (1 / (1 + np.exp(-steepness * (at - middle))) for at in (0.0, t, 1.0))
    return np.asarray((level - start) / (end - start))


SHAPES: dict[str, Shape] = {
    "linear": lambda t, _: t,
    "exponential": lambda t, r: _exponential(t, r.uniform(1, 4)),
    "power law": lambda t, r: t ** r.uniform(0.6, 2.5),
    "onset, linear": lambda t, r: _onset(t, r.uniform(0.2, 0.6)),
    "onset, exponential": lambda t, r: _exponential(_onset(t, r.uniform(0.2, 0.6)), r.uniform(1, 3)),
    "crack": lambda t, r: _crack(t, r.uniform(1.2, 2), r.uniform(0.1, 0.3)),
    "faster from a break on": lambda t, r: _broken(t, r.uniform(0.3, 0.8), r.uniform(2, 6)),
    "slower from a break on": lambda t, r: _broken(t, r.uniform(0.2, 0.6), r.uniform(0.15, 0.5)),
    "saturating": lambda t, r: _saturating(t, r.uniform(0.5, 1.5)),
    "steps": lambda t, r: np.cumsum(r.random(t.size) < 16 * t[1]) / 16,
    "random walk": lambda t, r: t + np.cumsum(r.normal(0, r.uniform(0.02, 0.15) * t[1] ** 0.5, t.size)),
    "logistic": lambda t, r: _logistic(t, r.uniform(4, 12), r.uniform(0.3, 0.6)),
}


def unit(shape: str, number: int) -> tuple[Evidence, float]:
    """Return the diagnoses of a unit up to its failure, and the hours of the failure [h]."""
    random = np.random.default_rng([11, number, list(SHAPES).index(shape)])
    progress = SHAPES[shape](AGEING, random)
    life = float(np.exp(random.uniform(np.log(400), np.log(8000))))
    end = life * float(AGEING[np.argmax(progress >= 1)])
    error = float(np.exp(random.uniform(np.log(0.002), np.log(0.015))))
    every = end / random.uniform(15, 50)
    hours = np.arange(every, end, every)
    levels = LIMIT * np.interp(hours / life, AGEING, progress) + random.normal(0, error, hours.size)
    seen, covariance = np.ones(1, bool), np.array([[error**2]])
    observed = tuple(
        Observation(float(at), np.array([level]), covariance, seen)
        for at, level in zip(hours, levels, strict=True)
    )
    return Evidence(f"{shape} {number}", "synthetic", float(hours[-1]), observed, components=1), end


def scores(shape: str, number: int, prior: Prior) -> Array:
    """Return for each share of life: probability of an earlier failure, median and CRPS over the true RUL."""
    evidence, end = unit(shape, number)
    past = follow(evidence, prior, seed=number).past
    hours = [belief.hours for belief in past]
    rows = []
    for share in SHARES:
        belief = past[max(int(np.searchsorted(hours, share * end, "right")), FEWEST) - 1]
        forecast = paths(drawn_states(belief, PATHS.paths), belief.prior, seed=number, settings=PATHS)
        level, noise = forecast.level[:, :, 0], forecast.noise[:, :, 0]
        sample = first_passage(forecast.hours, LIMIT - level, noise, stream(number, "first passage"))
        true, longest = end - belief.hours, PATHS.longest_hours
        median = float(np.median(np.minimum(sample, longest)))
        rows.append((np.mean(sample < true), median / true, crps(sample, true, longest=longest) / true))
    return np.array(rows)


def line(values: Array) -> str:
    """Return the five cells of a table row for scores (n, 3)."""
    earlier, median, score = values.T
    within = (earlier >= 0.05) & (earlier <= 0.95)
    shares = " | ".join(f"{100 * np.mean(share):.0f} %" for share in (within, earlier < 0.05, median > 1.2))
    return f"| {shares} | {np.median(median):.2f} | {np.mean(np.minimum(score, 5)):.2f} |"


def main() -> None:
    """Print a Markdown table: rows of all shapes at each share of life, and of each shape at half of life."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--units", type=int, default=20, help="of each shape")
    parser.add_argument("--first", type=int, default=0, help="number of the first unit")
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.units)
    by_shape = {shape: np.array([scores(shape, number, Prior()) for number in numbers]) for shape in SHAPES}
    header = "| | in the 90 % interval | failed before it | late by more than 20 % | median | CRPS |\n"
    header += "| --- | ---: | ---: | ---: | ---: | ---: |"
    print(header)
    for i, share in enumerate(SHARES):
        print(f"| all, at {share:g} of life {line(np.concatenate([row[:, i] for row in by_shape.values()]))}")
    for shape, of_shape in by_shape.items():
        print(f"| {shape}, at {SHARES[1]:g} {line(of_shape[:, 1])}")


if __name__ == "__main__":
    main()
