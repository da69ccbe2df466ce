"""Diagnoses of known faults: drawing them, running them on two cores, and what to count of them."""

import multiprocessing
import os
import sys
import time
from collections.abc import Hashable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

import numpy as np

import emaphm as ema
from bench.rig import Rig, recorded
from emaphm.actuator import NAMES
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array
from emaphm.estimation.bias_correction import MAX_CORRECTIONS

Key = TypeVar("Key", bound=Hashable)

PROCESSES = 2

SINGLE = ("friction", "backlash", "short", "eccentricity", "gain")
"""Kinds of small faults; a short is in any phase, an eccentricity in any direction."""

JUDGED = tuple(name for name in NAMES if name != "eccentricity_phase")
"""Components that may raise an alarm; the phase shares the verdict of the eccentricity."""


@dataclass(frozen=True)
class Case:
    """A recording of `faults` by `rig` and its diagnosis, both from `seed`; the rest as for `diagnose`."""

    rig: Rig
    faults: ema.Faults
    seed: int
    nuisances: tuple[str, ...] | None = None
    turns: int = MAX_CORRECTIONS


@dataclass(frozen=True)
class Outcome:
    """What came of a case: error [%]; by component of `NAMES` coverage, half-width and alarm; seconds.

    `moves` is false where the diagnosis says that the actuator stood still.
    """

    case: Case
    error: float
    covered: tuple[bool, ...]
    half_widths: tuple[float, ...]
    alarms: tuple[bool, ...]
    explained: bool
    moves: bool
    seconds: float


def random_faults(seed: int) -> ema.Faults:
    """Return faults with shorts up to 0.7, all else anywhere in [0, 1]."""
    vector = np.random.default_rng(seed).random(len(NAMES))
    vector[2:5] *= 0.7
    return ema.Faults.from_vector(vector)


def heavy_faults(seed: int) -> ema.Faults:
    """Return faults with shorts of 0.5 to 0.85 in each phase, all else anywhere in [0, 1]."""
    vector = np.random.default_rng(seed).random(len(NAMES))
    vector[2:5] = 0.5 + 0.35 * vector[2:5]
    return ema.Faults.from_vector(vector)


def small_fault(kind: str, size: float, seed: int) -> ema.Faults:
    """Return a single fault of `kind` in `SINGLE`: its component at `size`, a gain that far from healthy."""
    rng = np.random.default_rng([seed, 2])
    phase, direction, sign = rng.choice(list("abc")), rng.random(), rng.choice([-1, 1])
    if kind == "short":
        return ema.Faults.from_mapping({f"short_{phase}": size})
    if kind == "eccentricity":
        return ema.Faults(eccentricity=size, eccentricity_phase=direction)
    if kind == "gain":
        return ema.Faults(gain=HEALTHY.gain + sign * size)
    return ema.Faults.from_mapping({kind: size})


def diagnosed(case: Case) -> Outcome:
    """Return the outcome of one case; an error names it."""
    try:
        recording = recorded(case.rig, case.faults, case.seed)
        found = ema.diagnose(
            recording,
            ema.Actuator.thesis(),
            max_corrections=case.turns,
            nuisances=case.nuisances,
            seed=case.seed,
            workers=1,
        )
    except Exception as error:
        error.add_note(f"in {case}")
        raise
    truth = case.faults.vector
    intervals = [found.interval[name] for name in NAMES]
    return Outcome(
        case,
        float(ema.error_percent(truth, found.faults.vector)),
        tuple(holds(intervals[i], truth[i], name) for i, name in enumerate(NAMES)),
        tuple((high - low) / 2 for low, high in intervals),
        tuple(found.components[name].verdict == "degraded" for name in NAMES),
        found.explained,
        found.moves,
        found.seconds,
    )


def holds(interval: tuple[float, float], truth: float, name: str) -> bool:
    """Return whether an interval holds the truth; a phase's on the circle."""
    turns = (-1, 0, 1) if name == "eccentricity_phase" else (0,)
    return any(interval[0] <= truth + turn <= interval[1] for turn in turns)


def measured(plan: Mapping[Key, Sequence[Case]], what: str) -> dict[Key, list[Outcome]]:
    """Return the outcomes of each of the plan's lists of cases, in order; progress goes to stderr.

    They are run by `PROCESSES` processes started afresh, each case from its own seed, so that neither the
    number of processes nor the order matters.
    """
    cases = list(chain.from_iterable(plan.values()))
    # Small matrices gain nothing from threads, which only fight over the cores.
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    with ProcessPoolExecutor(PROCESSES, multiprocessing.get_context("spawn")) as pool:
        outcomes = _told(pool.map(diagnosed, cases), len(cases), what)
        return {key: [next(outcomes) for _ in of_key] for key, of_key in plan.items()}


def _told(outcomes: Iterator[Outcome], total: int, what: str) -> Iterator[Outcome]:
    began, line_ends = time.perf_counter(), "\r" if sys.stderr.isatty() else "\n"
    for done, outcome in enumerate(outcomes, 1):
        if sys.stderr.isatty() or 10 * done // total > 10 * (done - 1) // total:
            spent = time.perf_counter() - began
            print(
                f"{what}: {done} of {total} cases, {spent:.0f} s", end=line_ends, file=sys.stderr, flush=True
            )
        yield outcome


def errors(outcomes: Sequence[Outcome]) -> Array:
    """Return the errors [%], shape (n,)."""
    return np.array([one.error for one in outcomes])


def spread_of(errors: Array) -> str:
    """Return the median, the 95th percentile and the worst of `errors` [%] as pages quote them."""
    return f"{np.median(errors):.2f} / {np.percentile(errors, 95):.2f} / {errors.max():.2f}"


def coverage(outcomes: Sequence[Outcome]) -> Array:
    """Return by component the share whose interval holds the truth, shape (8,)."""
    return np.asarray(np.mean([one.covered for one in outcomes], axis=0))


def explained(outcomes: Sequence[Outcome]) -> float:
    """Return the share called explained."""
    return float(np.mean([one.explained for one in outcomes]))


def faulty(outcome: Outcome) -> tuple[bool, ...]:
    """Return by component of `JUDGED` whether it has a fault."""
    truth, healthy = outcome.case.faults, HEALTHY
    return tuple(getattr(truth, name) != getattr(healthy, name) for name in JUDGED)


def alarms(outcome: Outcome) -> tuple[bool, ...]:
    """Return by component of `JUDGED` whether it was called degraded."""
    return tuple(outcome.alarms[NAMES.index(name)] for name in JUDGED)


def detection(outcomes: Sequence[Outcome]) -> float:
    """Return the share of the faulty components that were called degraded."""
    called = [a for one in outcomes for a, fault in zip(alarms(one), faulty(one), strict=True) if fault]
    return float(np.mean(called))


def false_alarms(outcomes: Sequence[Outcome]) -> float:
    """Return the share of the healthy components that were called degraded."""
    called = [a for one in outcomes for a, fault in zip(alarms(one), faulty(one), strict=True) if not fault]
    return float(np.mean(called))


def recordings_alarmed(outcomes: Sequence[Outcome]) -> float:
    """Return the share of the recordings with any component called degraded."""
    return float(np.mean([any(alarms(one)) for one in outcomes]))
