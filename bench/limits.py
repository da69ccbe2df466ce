"""The map of the limits: the base setting with one thing at a time made worse, and a foreign plant.

    python -m bench.limits docs/limits.md

writes the page, and its figures into the folder of the same name. A second argument between 0 and 1 takes
that share of the cases, to try the machinery.
"""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binom

import emaphm as ema
from bench import foreign
from bench.cases import (
    SINGLE,
    Case,
    Outcome,
    coverage,
    detection,
    errors,
    explained,
    false_alarms,
    measured,
    random_faults,
    small_fault,
)
from bench.comparison import table
from bench.rig import BASE, BITS, CURRENT, EVERYTHING, HEAT_K, LOAD_NM, NOISE_A, Rig
from emaphm.actuator import NAMES

RANDOM, SMALL, HEALTHY = 20, 2, 6
"""Cases of a setting: random faults, small single faults of each kind, none."""

SMALL_SIZE = 0.05

DEFAULT = "load, temperature and what stands out estimated (default)"


@dataclass(frozen=True)
class Setting:
    """A rig, and what a diagnosis estimates besides the faults; the default where None."""

    rig: Rig
    nuisances: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Curve:
    """What is estimated along an axis, and at which of its values."""

    name: str
    nuisances: tuple[str, ...] | None
    values: tuple[Any, ...]


@dataclass(frozen=True)
class Axis:
    """One thing that varies about the base setting: how its values are written and what rigs they make."""

    name: str
    title: str
    label: str
    write: Callable[[Any], str]
    rig: Callable[[Any], Rig]
    curves: tuple[Curve, ...]
    note: str = ""

    def points(self) -> Iterator[tuple[Curve, Any, Setting]]:
        """Yield each value of each curve, with its setting."""
        for curve in self.curves:
            for value in curve.values:
                yield curve, value, Setting(self.rig(value), curve.nuisances)


def _axis(name: str, title: str, label: str, values: tuple[Any, ...], **options: Any) -> Axis:
    return Axis(name, title, label, curves=(Curve(DEFAULT, None, values),), **options)


def _percent(value: float) -> str:
    return f"{100 * value:+.0f} %" if value else "0"


INERTIA = (
    "The default estimates the inertia as well where a recording makes it suspicious, with a wide prior; who "
    "names it has the prior of the description, 5 %, which draws larger deviations back."
)
TENTH = (-0.1, -0.05, 0.0, 0.05, 0.1)
ENDS = (-0.1, 0.0, 0.1)

AXES = (
    _axis(
        "noise",
        "Noise",
        "noise on the current, A rms",
        (0.0, 0.02, NOISE_A, 0.1, 0.2, 0.5),
        write=lambda value: f"{value:g}",
        rig=lambda value: replace(BASE, noise=value),
    ),
    _axis(
        "bits",
        "Converters",
        "bits",
        (8, 10, BITS, 16, None),
        write=lambda value: "exact" if value is None else f"{value}",
        rig=lambda value: replace(BASE, adc_bits=value),
        note="Ranges as in `full_scales`: ±45 A, so that a step at 8 bits is 0.35 A, at 12 bits 0.022 A.",
    ),
    _axis(
        "rate",
        "Sample rate",
        "sample rate, kHz",
        (1e3, 2e3, 5e3, 1e4, 2e4),
        write=lambda value: f"{value / 1e3:g}",
        rig=lambda value: replace(BASE, sample_rate=value),
        note="The noise is the same in each row, so a higher rate also averages more of it.",
    ),
    _axis(
        "duration",
        "Duration",
        "duration, s",
        (0.25, 0.5, 1.0, 2.0),
        write=lambda value: f"{value:g}",
        rig=lambda value: replace(BASE, duration=value),
        note="The chirp sweeps 0 to 15 Hz over the duration.",
    ),
    _axis(
        "load",
        "Unknown load",
        "load, anywhere within ±N·m",
        (0.0, 0.1, LOAD_NM, 0.3, 0.4),
        write=lambda value: f"{value:g}",
        rig=lambda value: replace(BASE, load=(-value, value)),
    ),
    _axis(
        "temperature",
        "Unknown temperature",
        "windings and magnets warmer by, K",
        (-40.0, -20.0, 0.0, 20.0, 40.0),
        write=lambda value: f"{value:+g}" if value else "0",
        rig=lambda value: replace(BASE, heat=(value, value)),
    ),
    Axis(
        "supply",
        "Unknown supply",
        "supply off by",
        _percent,
        lambda value: replace(BASE, supply=(value, value)),
        (
            Curve(DEFAULT, None, TENTH),
            Curve("supply estimated too", ("load", "temperature", "supply"), ENDS),
        ),
    ),
    Axis(
        "inertia",
        "Unknown inertia",
        "inertia off by",
        _percent,
        lambda value: replace(BASE, inertia=(value, value)),
        (
            Curve(DEFAULT, None, TENTH),
            Curve("inertia estimated too", ("load", "temperature", "inertia"), ENDS),
        ),
        note=INERTIA,
    ),
)

RECORDED = {
    "current alone": Setting(replace(BASE, channels=CURRENT)),
    "current and line voltage (base setting)": Setting(BASE),
    "current, line voltage, position, speed": Setting(replace(BASE, channels=EVERYTHING)),
}

DEGREES = {"mild": foreign.MILD, "strong": foreign.STRONG}

FOREIGN = {"the reference model": Setting(BASE)} | {
    f"{name}, {degree}": Setting(replace(BASE, features=features))
    for degree, both in DEGREES.items()
    for name, features in foreign.parts(both).items()
}

Key = tuple[Setting, str]
"""A setting, and the kind of its cases: "random", "small" or "healthy"."""

Outcomes = Mapping[Key, list[Outcome]]


def cases(setting: Setting, share: float) -> dict[Key, list[Case]]:
    """Return a `share` of a setting's cases; the same faults, loads and noise in every setting."""

    def seeds(most: int) -> range:
        return range(max(1, round(share * most)))

    rig, nuisances = setting.rig, setting.nuisances
    return {
        (setting, "random"): [Case(rig, random_faults(seed), seed, nuisances) for seed in seeds(RANDOM)],
        (setting, "small"): [
            Case(rig, small_fault(kind, SMALL_SIZE, seed), seed, nuisances)
            for kind in SINGLE
            for seed in seeds(SMALL)
        ],
        (setting, "healthy"): [Case(rig, ema.Faults(), seed, nuisances) for seed in seeds(HEALTHY)],
    }


def plan(axes: Sequence[Axis], others: Sequence[Setting], share: float) -> dict[Key, list[Case]]:
    """Return the cases of all settings; those that several axes pass through are there once."""
    settings = [setting for axis in axes for _, _, setting in axis.points()] + list(others)
    return {key: of_key for setting in settings for key, of_key in cases(setting, share).items()}


@dataclass(frozen=True)
class Figures:
    """What is said of a setting: errors in percent, the rest as shares.

    Coverage is over the random faults; detection and false alarms over small single faults and healthy
    recordings, of components.
    """

    median: float
    most: float
    mean_coverage: float
    least_coverage: float
    least_covered: str
    explained: float
    detection: float
    false_alarms: float
    cases: int

    @classmethod
    def of(cls, setting: Setting, outcomes: Outcomes) -> "Figures":
        """Count the outcomes of a setting."""
        random, small, healthy = (outcomes[setting, kind] for kind in ("random", "small", "healthy"))
        found, covered = errors(random), coverage(random)
        return cls(
            float(np.median(found)),
            float(np.percentile(found, 95)),
            float(covered.mean()),
            float(covered.min()),
            NAMES[int(covered.argmin())],
            explained(random),
            detection(small),
            false_alarms([*small, *healthy]),
            len(random),
        )

    @property
    def overconfident(self) -> bool:
        """Whether intervals miss the truth more often than chance lets them, most fits being explained."""
        return self.explained > 0.5 and self.least_coverage < by_chance(self.cases)

    def row(self) -> list[str]:
        """Return the cells of a table, in the order of `HEADER`."""
        weakest = f" ({self.least_covered})" if self.least_coverage < 1 else ""
        return [
            f"{self.median:.2f} / {self.most:.2f}",
            f"{100 * self.mean_coverage:.0f} %",
            f"{100 * self.least_coverage:.0f} %{weakest}",
            f"{100 * self.explained:.0f} %",
            f"{100 * self.detection:.0f} %",
            f"{100 * self.false_alarms:.1f} %",
        ]


HEADER = (
    "error: median / 95th percentile, %",
    "coverage: mean",
    "least",
    "explained",
    "5 % faults detected",
    "false alarms",
)


def by_chance(count: int) -> float:
    """Return the least share of `count` that a true 95 % interval holds but once in a thousand times."""
    return float(binom.ppf(1e-3, count, 0.95)) / count


def report(
    axes: Sequence[Axis],
    tables: Mapping[str, Mapping[str, Setting]],
    outcomes: Outcomes,
    folder: str,
) -> Iterator[str]:
    """Yield the lines of the page; `tables` are settings by title and name, `folder` has the figures."""
    base = Figures.of(Setting(BASE), outcomes)
    yield "# A map of the limits\n"
    yield (
        "Made by `make study`. The base setting is that of [accuracy.md](accuracy.md): "
        f"{NOISE_A:g} A of noise, {BITS}-bit converters, load within ±{LOAD_NM:g} N·m and windings within "
        f"±{HEAT_K:g} K unknown, current and line voltage recorded, a 0.5 s chirp at 5 kHz. Here one thing "
        "at a time is varied about it; all settings share the same faults, loads and temperatures.\n"
    )
    small, healthy = (len(outcomes[Setting(BASE), kind]) for kind in ("small", "healthy"))
    yield (
        f"Of each setting, {base.cases} recordings with random faults give error, coverage of the 95 % "
        "intervals (the mean over the components and the least, with its component) and the share called "
        f"explained. {small} with a single fault of {100 * SMALL_SIZE:.0f} % and {healthy} healthy ones give "
        "the share of these small faults that were called degraded, and of the healthy components that were "
        f"(false alarms, of {6 * small + 7 * healthy}). So few cases show where the diagnosis breaks, not "
        "differences of some percent: of true 95 % intervals, a component would show less than "
        f"{100 * by_chance(base.cases):.0f} % in one setting of a thousand.\n"
    )
    yield "## Where it is wrong without saying so\n"
    yield from _overconfident(axes, tables, outcomes)
    for title, settings in tables.items():
        yield f"\n## {title}\n"
        if title in NOTES:
            yield NOTES[title] + "\n"
        rows = [[name, *Figures.of(setting, outcomes).row()] for name, setting in settings.items()]
        yield table([title.lower(), *HEADER], rows)
    for axis in axes:
        yield f"\n## {axis.title}\n"
        if axis.note:
            yield axis.note + "\n"
        yield f"![{axis.title.lower()}]({folder}/{axis.name}.svg)\n"
        yield _reading(axis, outcomes) + "\n"
        several = len(axis.curves) > 1
        rows = [
            [axis.write(value), *([curve.name] if several else []), *Figures.of(setting, outcomes).row()]
            for curve, value, setting in axis.points()
        ]
        yield table([axis.label, *(["estimated"] if several else []), *HEADER], rows)


def _reading(axis: Axis, outcomes: Outcomes) -> str:
    """Return what an axis does to the median error, and what estimating more besides does about it."""
    medians = [
        (curve, value, Figures.of(setting, outcomes).median) for curve, value, setting in axis.points()
    ]
    by_default = {value: median for curve, value, median in medians if curve is axis.curves[0]}
    least, largest = (pick(by_default, key=by_default.__getitem__) for pick in (min, max))
    sentence = (
        f"By {axis.label}, the median error is least at {axis.write(least)} ({by_default[least]:.2f} %) "
        f"and largest at {axis.write(largest)} ({by_default[largest]:.2f} %)"
    )
    for curve in axis.curves[1:]:
        changes = ", ".join(
            f"{by_default[value]:.2f} to {median:.2f} % at {axis.write(value)}"
            for one, value, median in medians
            if one is curve
        )
        sentence += f"; with {curve.name} it goes from {changes}"
    return sentence + "."


def _degree(features: foreign.Features) -> str:
    """Return how strong a foreign plant's features are."""
    assert features.friction is not None  # noqa: S101 - it has them all
    assert features.shaft is not None  # noqa: S101 - it has them all
    return (
        f"friction {features.friction.speed:g} and {features.friction.smoothing:g} rad/s, shaft "
        f"{features.shaft.stiffness:g} N·m/rad, lag {1e6 * features.sensor_lag:g} µs"
    )


NOTES = {
    "Plant": (
        "Recordings by a plant that is not our reference model, diagnosed as if it were. Smooth friction: "
        "Stribeck's, falling from the static to the dynamic level over a first speed, and passing through "
        "zero like a tanh of a second. Compliant shaft: a damped spring, its backlash a dead zone that "
        "uncouples the user's inertia. Lagging sensors: for the drive as for the recorder. "
        + "; ".join(f"{degree}: {_degree(features)}" for degree, features in DEGREES.items())
        + ". Without these features that plant agrees with the reference model to rounding, which its tests "
        "check. Where the column `explained` is low, errors are announced; where it is high, they are not."
    ),
}


def _overconfident(
    axes: Sequence[Axis], tables: Mapping[str, Mapping[str, Setting]], outcomes: Outcomes
) -> Iterator[str]:
    """Yield the settings whose intervals are too narrow though the recordings are called explained."""
    named = {
        setting: f"{title.lower()}: {name}"
        for title, of_title in tables.items()
        for name, setting in of_title.items()
    }
    for axis in axes:
        for curve, value, setting in axis.points():
            estimated = f", {curve.name}" if len(axis.curves) > 1 else ""
            named.setdefault(setting, f"{axis.label}: {axis.write(value)}{estimated}")
    figures = {name: Figures.of(setting, outcomes) for setting, name in named.items()}
    found = {name: one for name, one in figures.items() if one.overconfident}
    yield (
        "Settings with a component whose interval holds the truth less often than chance allows, though more "
        "than half of the recordings are called explained: "
        + (f"{len(found)} of {len(figures)}.\n" if found else f"none of {len(figures)}.")
    )
    for name, one in found.items():
        yield (
            f"- {name}: {one.least_covered} held by {100 * one.least_coverage:.0f} %, "
            f"{100 * one.explained:.0f} % explained, median error {one.median:.2f} %"
        )


def main() -> None:
    """Write the page to the path given, and the figures beside it."""
    from bench.limits_figures import draw

    page = Path(sys.argv[1])
    share = float(sys.argv[2]) if len(sys.argv) > 2 else 1.0
    tables = {"Recorded": RECORDED, "Plant": FOREIGN}
    others = [setting for of_title in tables.values() for setting in of_title.values()]
    outcomes = measured(plan(AXES, others, share), "limits")
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    for axis in AXES:
        (folder / f"{axis.name}.svg").write_bytes(draw(axis, outcomes))
    page.write_text("\n".join(report(AXES, tables, outcomes, folder.name)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
