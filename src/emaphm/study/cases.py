"""The faults of a study's cases: named in the plan, or drawn with the number of the case as the seed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator

from emaphm.actuator import NAMES, Faults
from emaphm.actuator.faults import HEALTHY
from emaphm.actuator.section import Section
from emaphm.errors import StudyError
from emaphm.experiment.test_setup import LARGEST_SHORT
from emaphm.study.rig import Label

MOST_RUNS = 1_000_000
"""Largest number of runs of a plan: each is a row in memory."""

Count = Annotated[int, Field(ge=1, le=MOST_RUNS)]
CountOrNone = Annotated[int, Field(ge=0, le=MOST_RUNS)]

SINGLE = ("friction", "backlash", "short", "eccentricity", "gain")
"""Kinds of small faults; the phase of a short and the direction of an eccentricity are random."""

HEAVY_SHORTS = (0.5, 0.85)
"""Range of the shorts of a heavy case, in each phase."""

CaseKind = Literal["named", "random", "heavy", "small", "healthy"]


@dataclass(frozen=True)
class Case:
    """A fault vector and its name; `number`, from 0, is its index among the `of` cases of its kind."""

    name: str
    kind: CaseKind
    truth: tuple[float, ...]
    number: int
    of: int

    @classmethod
    def of_faults(cls, name: str, kind: CaseKind, faults: Faults, number: int, of: int) -> "Case":
        """Return the case of `faults`."""
        return cls(name, kind, tuple(map(float, faults.vector)), number, of)


class RandomCases(Section):
    """Cases "random 1", "random 2", …: vectors drawn from [0, 1], with shorts from [0, `largest_short`]."""

    count: Count
    seed: Annotated[int, Field(ge=0)] = 0
    largest_short: Annotated[float, Field(ge=0, le=1)] = LARGEST_SHORT

    @property
    def cases(self) -> dict[str, dict[str, float]]:
        """The cases by name."""
        vectors = np.random.default_rng(self.seed).random((self.count, len(NAMES)))
        vectors[:, 2:5] *= self.largest_short
        return {
            f"random {i + 1}": dict(zip(NAMES, map(float, vector), strict=True))
            for i, vector in enumerate(vectors)
        }


class SmallFaults(Section):
    """`count` cases of each kind of single small fault, with the component at `size`."""

    size: Annotated[float, Field(gt=0, le=0.5)]
    count: Count


class Group(Section):
    """Cases that are run on some rigs of a plan with some of its methods; by default on all, with all.

    `cases` selects named cases of the plan; `random`, `heavy` and `healthy` are numbers of drawn cases;
    `small` lists small single faults. Case n of a kind has the seed n (plus that of the plan) for its faults,
    rig, recording and search; run r of case n has the seed n · runs + r.
    """

    label: Label
    rigs: tuple[Label, ...] = ()
    methods: tuple[Label, ...] = ()
    runs: Count = 1
    cases: tuple[Label, ...] = ()
    random: CountOrNone = 0
    heavy: CountOrNone = 0
    healthy: CountOrNone = 0
    small: tuple[SmallFaults, ...] = ()

    @field_validator("rigs", "methods", "cases", "small")
    @classmethod
    def _once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(map(repr, values))) < len(values):
            raise StudyError("a value is given twice; give each value once")
        return values

    def all_cases(self, named: Mapping[str, Mapping[str, float]], seed: int) -> Iterator[Case]:
        """Yield the cases: named cases from `named`, the others drawn with seeds from `seed` on."""
        for n, name in enumerate(self.cases):
            yield Case.of_faults(name, "named", Faults.from_mapping(named[name]), n, len(self.cases))
        for n in range(self.random):
            yield Case.of_faults(f"random {n}", "random", random_faults(seed + n), n, self.random)
        for n in range(self.heavy):
            yield Case.of_faults(f"heavy {n}", "heavy", heavy_faults(seed + n), n, self.heavy)
        for small in self.small:
            for kind in SINGLE:
                for n in range(small.count):
                    faults = small_fault(kind, small.size, seed + n)
                    name = f"{kind} {100 * small.size:g} %, {n}"
                    yield Case.of_faults(name, "small", faults, n, small.count)
        for n in range(self.healthy):
            yield Case.of_faults(f"healthy {n}", "healthy", HEALTHY, n, self.healthy)

    @property
    def count(self) -> int:
        """The number of cases."""
        small = sum(len(SINGLE) * small.count for small in self.small)
        return len(self.cases) + self.random + self.heavy + self.healthy + small


def random_faults(seed: int) -> Faults:
    """Return random faults: shorts in [0, `LARGEST_SHORT`], all other components in [0, 1]."""
    vector = np.random.default_rng(seed).random(len(NAMES))
    vector[2:5] *= LARGEST_SHORT
    return Faults.from_vector(vector)


def heavy_faults(seed: int) -> Faults:
    """Return random faults: shorts within `HEAVY_SHORTS` in each phase, all other components in [0, 1]."""
    low, high = HEAVY_SHORTS
    vector = np.random.default_rng(seed).random(len(NAMES))
    vector[2:5] = low + (high - low) * vector[2:5]
    return Faults.from_vector(vector)


def small_fault(kind: str, size: float, seed: int) -> Faults:
    """Return a single fault of a `kind` in `SINGLE`: the component at `size`, a gain at healthy ± `size`."""
    rng = np.random.default_rng([seed, 2])
    phase, direction, sign = rng.choice(list("abc")), rng.random(), rng.choice([-1, 1])
    if kind == "short":
        return Faults.from_mapping({f"short_{phase}": size})
    if kind == "eccentricity":
        return Faults(eccentricity=size, eccentricity_phase=direction)
    if kind == "gain":
        return Faults(gain=HEALTHY.gain + sign * size)
    return Faults.from_mapping({kind: size})
