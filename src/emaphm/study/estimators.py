"""How good an estimator is: alone, as the start of a search, and next to the full search.

    python -m emaphm.study.estimators unit.estimator --share 0.1

prints tables in Markdown, on the base setting of docs/accuracy.md with the manoeuvre of the default chirp:
errors, coverage, false alarms and detected faults; foreign plants and spoilt recordings; the time of each
diagnosis; and how many recordings a core answers in a second. An estimator of the current alone is also asked
about the thesis's multiple faults. All diagnoses estimate the nuisances that the estimator was trained on.
docs/fast_estimator.md quotes them.
"""

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.amortized import Estimator, answer_alone
from emaphm.arrays import Array
from emaphm.diagnosis import Diagnosis
from emaphm.diagnosis.error_metric import error_percent
from emaphm.errors import EmaphmError
from emaphm.estimation.posing import problem_of
from emaphm.execution import Task, outcomes
from emaphm.fleet import DiagnosisSettings
from emaphm.random_streams import stream
from emaphm.recording import Recording
from emaphm.study.analysis.rates import holds
from emaphm.study.cases import SINGLE, heavy_faults, random_faults, small_fault
from emaphm.study.plan import Plan
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig
from emaphm.study.spoilt.judging import OUTCOME_TITLES, OUTCOMES, UNDETECTED_ERROR, judged, refused
from emaphm.study.spoilt.run import cases as spoilt_cases
from emaphm.study.spoilt.run import spoilt
from emaphm.text_table import markdown_table

METHODS = ("estimator alone", "estimator, corrected", "full search")
WITHOUT_SEARCH = "estimator without search"
"""Of the first method what its answer alone is: where it would search, the outcome is `NOT_TAKEN`."""

NOT_TAKEN = "not taken"

COUNTS = {"random": 300, "heavy": 300, "healthy": 500, "small": 50}
"""Recordings of each group, of small faults each kind; as in the plan `accuracy`, but for heavy shorts."""

SMALL = 0.05
MULTIPLE = 10
FOREIGN_EACH = 20
LARGEST_BATCH = 1024
"""Recordings answered at once where speed is measured."""


@dataclass(frozen=True)
class RecordingCase:
    """A recording of a `group`: of true faults on a rig, or a spoilt one, by its number."""

    group: str
    label: str
    truth: tuple[float, ...]
    rig: Rig | None
    number: int


def of_base_setting(channels: tuple[str, ...], share: float) -> Iterator[RecordingCase]:
    """Yield the cases on the base setting."""
    rig = Rig(label="base", channels=channels)
    count = {name: max(1, round(share * number)) for name, number in COUNTS.items()}

    def case(group: str, label: str, faults: Faults, number: int) -> RecordingCase:
        return RecordingCase(group, label, tuple(map(float, faults.vector)), rig, number)

    for n in range(count["random"]):
        yield case("random", "random", random_faults(n), n)
    for n in range(count["heavy"]):
        yield case("heavy", "heavy", heavy_faults(n), n)
    for n in range(count["healthy"]):
        yield case("healthy", "healthy", Faults(), n)
    for kind in SINGLE:
        for n in range(count["small"]):
            yield case("small", kind, small_fault(kind, SMALL, n), n)


def of_multiple(channels: tuple[str, ...]) -> Iterator[RecordingCase]:
    """Yield the thesis's multiple faults in its conditions, if `channels` are the thesis's: the current.

    The recordings differ by their switching, as in the plan `accuracy`.
    """
    plan = Plan.load("accuracy")
    rig = next(rig for rig in plan.rigs if rig.label == "switching disturbed")
    if channels == rig.channels:
        faults = Faults.from_mapping(plan.cases["multiple"])
        for n in range(MULTIPLE):
            yield RecordingCase("multiple", "multiple", tuple(map(float, faults.vector)), rig, n)


def of_unlike(channels: tuple[str, ...], share: float) -> Iterator[RecordingCase]:
    """Yield recordings that are not like any simulation: of foreign plants, and spoilt ones."""
    foreign = [rig for rig in Plan.load("plants").rigs if rig.foreign is not None and not rig.calibrated]
    for rig in foreign:
        own = rig.model_copy(update={"channels": channels})
        for n in range(max(1, round(share * FOREIGN_EACH))):
            yield RecordingCase("foreign", rig.label, tuple(map(float, random_faults(n).vector)), own, n)
    for n, one in enumerate(spoilt_cases()):
        if one.channels == "voltage" and n % max(1, round(1 / share)) == 0:
            yield RecordingCase("spoilt", one.spoilt_class, (), None, n)


def perform(case: RecordingCase, method: str, path: str) -> dict[str, Any]:
    """Return what a method makes of a case; an error of the user's is an outcome too."""
    actuator = Actuator.thesis()
    if case.rig is None:
        try:
            recording, actuator, truth = spoilt(spoilt_cases()[case.number])
        except EmaphmError as error:
            return refused(str(error))
    else:
        truth = Faults(*case.truth)
        recording = recorded(case.rig, actuator, Manoeuvre(), truth, case.number)
    try:
        return _diagnosed(recording, actuator, truth, method, path, case.number)
    except EmaphmError as error:
        return refused(str(error))


def _diagnosed(
    recording: Recording, actuator: Actuator, truth: Faults, method: str, path: str, seed: int
) -> dict[str, Any]:
    if method == WITHOUT_SEARCH:
        found = answer_alone(Estimator.load(path), recording, actuator, seed=seed)
        if isinstance(found, Diagnosis):
            return judged(found, truth) | {"method": found.method, "error": _error(found, truth)}
        return {"outcome": NOT_TAKEN, "reasons": list(found)}
    settings = DiagnosisSettings(
        estimator=None if method == METHODS[2] else path,
        fast=method == METHODS[0],
        nuisances=None if method == METHODS[0] else Estimator.load(path).setup.nuisances,
        seed=seed,
    )
    processor = time.process_time()
    diagnosis = settings.diagnosed(recording, actuator)
    return judged(diagnosis, truth) | {
        "method": diagnosis.method,
        "error": _error(diagnosis, truth),
        "covered": [
            bool(holds(name, diagnosis.interval[name], true))
            for name, true in zip(NAMES, truth.vector, strict=True)
        ],
        "degraded": [diagnosis.components[name].verdict == "degraded" for name in NAMES],
        "moves": diagnosis.moves,
        "wall_s": diagnosis.seconds,
        "processor_s": time.process_time() - processor,
    }


def _error(diagnosis: Diagnosis, truth: Faults) -> float:
    return float(error_percent(truth.vector, diagnosis.faults.vector))


def accuracy_table(found: Sequence[tuple[RecordingCase, str, dict[str, Any]]]) -> str:
    """Return errors, shares, intervals and times by group and method."""
    header = (
        "recordings",
        "method",
        "error: median / 95th percentile / worst, %",
        "at most 2 %",
        "at most 5 %",
        "explained",
        "as asked",
        "processor time: median / 95th percentile, s",
    )
    rows = []
    for group in ("random", "heavy", "multiple", "healthy", "small"):
        for method in METHODS:
            one = [r for c, m, r in found if c.group == group and m == method and r.get("moves")]
            if not one:
                continue
            errors, times = (np.array([r[key] for r in one]) for key in ("error", "processor_s"))
            asked = {METHODS[0]: "estimator", METHODS[1]: "estimator+lsq", METHODS[2]: "hybrid"}[method]
            rows.append(
                (
                    f"{group}, {len(one)}",
                    method,
                    f"{np.median(errors):.2f} / {_p95(errors):.2f} / {errors.max():.2f}",
                    _percent(errors <= 2),
                    _percent(errors <= 5),
                    _percent([_claims(r) for r in one]),
                    _percent([r["method"] == asked for r in one]),
                    f"{np.median(times):.3f} / {_p95(times):.3f}",
                )
            )
    return markdown_table(header, rows, words=2)


def _p95(values: Array) -> float:
    return float(np.quantile(values, 0.95))


def _claims(result: dict[str, Any]) -> bool:
    return result["outcome"] not in ("refused", "not explained")


def coverage_table(found: Sequence[tuple[RecordingCase, str, dict[str, Any]]]) -> str:
    """Return the share of recordings that move whose interval holds the truth, by group and component."""
    rows = []
    for group in ("random", "heavy"):
        for method in METHODS:
            one = [r["covered"] for c, m, r in found if c.group == group and m == method and r.get("moves")]
            if one:
                rows.append((f"{group}, {len(one)}", method, *map(_percent, np.mean(one, axis=0))))
    return markdown_table(("recordings", "method", *NAMES), rows, words=2)


def alarms_table(found: Sequence[tuple[RecordingCase, str, dict[str, Any]]]) -> str:
    """Return false alarms on healthy recordings, and how often each small fault is called degraded."""
    rows = []
    for method in METHODS:
        healthy = [r for c, m, r in found if c.group == "healthy" and m == method and "degraded" in r]
        if not healthy:
            continue
        rates = [_percent([any(r["degraded"]) for r in healthy])]
        for kind in SINGLE:
            of_kind = [
                r
                for c, m, r in found
                if c.group == "small" and c.label == kind and m == method and "degraded" in r
            ]
            rates.append(_percent([_detected(r, kind) for r in of_kind]))
        rows.append((method, *rates))
    return markdown_table(("method", "healthy: false alarms", *SINGLE), rows)


def _detected(result: dict[str, Any], kind: str) -> bool:
    which = {name for name in NAMES if name.startswith("short_" if kind == "short" else kind)}
    return any(called for name, called in zip(NAMES, result["degraded"], strict=True) if name in which)


def unlike_table(found: Sequence[tuple[RecordingCase, str, dict[str, Any]]]) -> str:
    """Return what became of foreign and spoilt recordings: by whom they were answered, and how well."""
    answered = "answered by the network alone, by least squares from it, by the full search"
    columns = (*OUTCOMES, NOT_TAKEN)
    rows = []
    for group in ("foreign", "spoilt"):
        for label in dict.fromkeys(c.label for c, _, _ in found if c.group == group):
            for method in (*METHODS, WITHOUT_SEARCH):
                one = [r for c, m, r in found if c.group == group and c.label == label and m == method]
                if not one:
                    continue
                tally = Counter(r["outcome"] for r in one)
                by = Counter(r.get("method") for r in one)
                wrong = sorted(r["error"] for r in one if r["outcome"] == UNDETECTED_ERROR)
                rows.append(
                    (
                        label,
                        method,
                        *(str(tally[name] or "") for name in columns),
                        ", ".join(f"{error:.1f}" for error in wrong),
                        f"{by['estimator']}, {by['estimator+lsq']}, {by['hybrid']}",
                    )
                )
    header = ("recordings", "method", *OUTCOME_TITLES, NOT_TAKEN, "undetected errors, %", answered)
    return markdown_table(header, rows, words=2)


def speed_table(path: Path) -> str:
    """Return how fast the network answers on one core, alone and in batches."""
    estimator = Estimator.load(path)
    rng, size = stream(0, "rows of a batch"), LARGEST_BATCH
    blocks = estimator.network.projection.mean.size // len(estimator.setup.channels)
    rows = rng.normal(size=(size, len(estimator.setup.channels), blocks)).astype(np.float32)
    recording = recorded(
        Rig(label="base", channels=estimator.setup.channels), Actuator.thesis(), Manoeuvre(), Faults(), 0
    )
    inputs = problem_of(recording, Actuator.thesis(), workers=1).inputs
    table = []
    for count in (1, 16, size):
        repeats = max(1, 200 // count)
        estimator.answers(rows[:count], inputs)
        began = time.process_time()
        for _ in range(repeats):
            estimator.answers(rows[:count], inputs)
        each = (time.process_time() - began) / repeats / count
        table.append((str(count), f"{1e3 * each:.3f}", f"{1 / each:,.0f}"))
    header = ("recordings at once", "processor time of each, ms", "recordings a second")
    return markdown_table(header, table, words=0)


def _percent(values: Any) -> str:
    return f"{100 * float(np.mean(values)):.1f} %"


def main() -> None:
    """Run the study as the command line asks."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.estimators", description=__doc__)
    parser.add_argument("estimator", type=Path, help="file of 'emaphm train'")
    parser.add_argument("--workers", type=int, help="processes; one a core if left out")
    parser.add_argument("--share", type=float, default=1.0, help="share of the recordings to try, up to 1")
    parser.add_argument("--methods", nargs="+", default=METHODS, choices=(*METHODS, WITHOUT_SEARCH))
    parser.add_argument("--groups", nargs="+", default=(), help="some of the groups of recordings")
    asked = parser.parse_args()
    channels = Estimator.load(asked.estimator).setup.channels
    every = [
        *of_base_setting(channels, asked.share),
        *of_multiple(channels),
        *of_unlike(channels, asked.share),
    ]
    chosen = [(c, m) for c in every if not asked.groups or c.group in asked.groups for m in asked.methods]
    tasks = [Task(i, perform, (c, m, str(asked.estimator)), name=c.label) for i, (c, m) in enumerate(chosen)]
    results: dict[int, dict[str, Any]] = {}
    for outcome in outcomes(tasks, workers=asked.workers):
        results[outcome.index] = refused(outcome.failure) if outcome.failure else outcome.result
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{len(results)} of {len(tasks)}")
    found = [(c, m, results[i]) for i, (c, m) in enumerate(chosen)]
    for table in (accuracy_table, coverage_table, alarms_table, unlike_table):
        print(table(found), end="\n\n")
    print(speed_table(asked.estimator))


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
