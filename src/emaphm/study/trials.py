"""The trials of a plan: combinations of method and case with their seeds."""

import hashlib
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from emaphm.actuator import Faults
from emaphm.errors import StudyError
from emaphm.study.cases import Case, CaseKind, Group
from emaphm.study.contestant import Contestant
from emaphm.study.plan import Plan
from emaphm.study.rig import Rig


@dataclass(frozen=True)
class Trial:
    """One run of a method on a case. `index` is its number in the plan; all randomness comes from `seed`.

    `rig` records the case; without a rig, the recording is that of the actuator as described, with white
    noise of `noise_A` [A rms] on the current. `run` is the number of the repetition. `rank` is the number of
    the trial among the `of` trials that differ only in case and repetition: a share consists of the first
    ones.
    """

    index: int
    group: str
    case: str
    case_kind: CaseKind
    truth: tuple[float, ...]
    contestant: Contestant
    model: str
    fitness: str
    equivalent: Literal["torque", "active", "magnitude"]
    noise_A: float
    rig: Rig | None
    run: int
    seed: int
    rank: int
    of: int


def trials_of(plan: Plan, share: float = 1.0) -> tuple[Trial, ...]:
    """Return the trials; the first runs of all cases and methods come first: half a study covers all cases.

    For a `share` in (0, 1], the first trials of each kind of case, rig, method and variant, at least one of
    each.

    Raises
    ------
    StudyError
        The share is outside of its range.
    """
    if not 0 < share <= 1:
        raise StudyError(f"a share of {share:g} cannot be taken; give more than 0, up to 1")
    trials = _trials_of_groups(plan) if plan.groups else _all_combinations(plan)
    return tuple(trial for trial in trials if trial.rank < max(1, round(share * trial.of)))


def _all_combinations(plan: Plan) -> Iterator[Trial]:
    combinations = itertools.product(
        range(plan.runs),
        plan.models,
        plan.fitnesses,
        plan.equivalents,
        plan.noises_A,
        plan.rigs or (None,),
        enumerate(plan.all_cases.items()),
        plan.methods,
    )
    count = len(plan.all_cases)
    for index, combination in enumerate(combinations):
        run, model, fitness, form, noise, rig, (place, (case, values)), contestant = combination
        yield Trial(
            index=index,
            group="",
            case=case,
            case_kind="named" if case in plan.cases else "random",
            truth=tuple(map(float, Faults.from_mapping(values).vector)),
            contestant=contestant,
            model=model,
            fitness=fitness,
            equivalent=form,
            noise_A=noise if rig is None else rig.noise,
            rig=rig,
            run=run,
            seed=_seed(plan.seed, case, run),
            rank=run * count + place,
            of=plan.runs * count,
        )


def _trials_of_groups(plan: Plan) -> Iterator[Trial]:
    """Yield the trials of the groups, ordered by rank."""
    ordered = []
    for group in plan.groups:
        rigs = [plan.rig_named[label] for label in group.rigs] or plan.rigs
        methods = [plan.method_named[label] for label in group.methods] or plan.methods
        for case, run in itertools.product(group.all_cases(plan.cases, plan.seed), range(group.runs)):
            combinations = itertools.product(plan.models, plan.fitnesses, rigs, methods)
            ordered += [(group, case, run, *combination) for combination in combinations]
    ordered.sort(key=lambda row: _rank(row[0], row[1], row[2]))
    for index, (group, case, run, model, fitness, rig, contestant) in enumerate(ordered):
        rank = _rank(group, case, run)
        yield Trial(
            index=index,
            group=group.label,
            case=case.name,
            case_kind=case.kind,
            truth=case.truth,
            contestant=contestant,
            model=model,
            fitness=fitness,
            equivalent="torque",
            noise_A=rig.noise,
            rig=rig,
            run=run,
            seed=plan.seed + rank,
            rank=rank,
            of=case.of * group.runs,
        )


def _rank(group: Group, case: Case, run: int) -> int:
    return case.number * group.runs + run


def _seed(seed: int, case: str, run: int) -> int:
    """Return a seed that differs between cases and runs, and is the same for every method."""
    digest = hashlib.sha256(f"{seed}/{case}/{run}".encode()).digest()
    return int.from_bytes(digest[:4], "big") >> 1
