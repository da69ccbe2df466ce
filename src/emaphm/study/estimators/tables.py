"""Markdown tables of the study of an estimator."""

import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.amortized import Estimator
from emaphm.arrays import Array, Flags
from emaphm.estimation.posing import problem_of
from emaphm.random_streams import stream
from emaphm.study.cases import SINGLE
from emaphm.study.estimators.cases import RecordingCase
from emaphm.study.estimators.trial import METHODS, NOT_TAKEN, WITHOUT_SEARCH
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig
from emaphm.study.spoilt.judging import OUTCOME_TITLES, OUTCOMES, UNDETECTED_ERROR
from emaphm.text_table import NOTHING, markdown_table

LARGEST_BATCH = 1024
"""Largest batch of recordings in the measurement of the speed."""

Outcomes = Sequence[tuple[RecordingCase, str, dict[str, Any]]]
"""Recording, method and result of each trial."""


def accuracy_table(outcomes: Outcomes) -> str:
    """Return a table of errors, shares and times by group and method."""
    header = (
        "recordings",
        "method",
        "error: median / 95th percentile / worst, %",
        "at most 2 %",
        "at most 5 %",
        "explained",
        "answered as requested",
        "processor time: median / 95th percentile, s",
    )
    rows = []
    for group in ("random", "heavy", "multiple", "healthy", "small"):
        for method in METHODS:
            moving = [r for r in _results(outcomes, group, method) if r.get("moves")]
            if not moving:
                continue
            errors, times = (np.array([r[key] for r in moving]) for key in ("error", "processor_s"))
            requested = {METHODS[0]: "estimator", METHODS[1]: "estimator+lsq", METHODS[2]: "hybrid"}[method]
            rows.append(
                (
                    f"{group}, {len(moving)}",
                    method,
                    f"{np.median(errors):.2f} / {_p95(errors):.2f} / {errors.max():.2f}",
                    _percent(errors <= 2),
                    _percent(errors <= 5),
                    _percent([_is_explained(r) for r in moving]),
                    _percent([r["method"] == requested for r in moving]),
                    f"{np.median(times):.3f} / {_p95(times):.3f}",
                )
            )
    return markdown_table(header, rows, words=2)


def _results(outcomes: Outcomes, group: str, method: str, label: str | None = None) -> list[dict[str, Any]]:
    """Return the results of a group and a method, only of recordings with a `label` if it is given."""
    return [
        result
        for case, by, result in outcomes
        if case.group == group and by == method and label in (None, case.label)
    ]


def _p95(values: Array) -> float:
    return float(np.quantile(values, 0.95))


def _is_explained(result: dict[str, Any]) -> bool:
    return result["outcome"] not in ("refused", "not explained")


def coverage_table(outcomes: Outcomes) -> str:
    """Return a table of the coverage of the intervals in recordings that move, by group and component."""
    rows = []
    for group in ("random", "heavy"):
        for method in METHODS:
            covered = [r["covered"] for r in _results(outcomes, group, method) if r.get("moves")]
            if covered:
                rows.append((f"{group}, {len(covered)}", method, *map(_percent, zip(*covered, strict=True))))
    return markdown_table(("recordings", "method", *NAMES), rows, words=2)


def alarms_table(outcomes: Outcomes) -> str:
    """Return a table of the rates of false alarms on healthy recordings, and of detected small faults."""
    rows = []
    for method in METHODS:
        healthy = [r for r in _results(outcomes, "healthy", method) if "degraded" in r]
        if not healthy:
            continue
        rates = [_percent([any(r["degraded"]) for r in healthy])]
        for kind in SINGLE:
            of_kind = [r for r in _results(outcomes, "small", method, kind) if "degraded" in r]
            rates.append(_percent([_detected(r, kind) for r in of_kind]))
        rows.append((method, *rates))
    return markdown_table(("method", "healthy: false alarms", *SINGLE), rows)


def _detected(result: dict[str, Any], kind: str) -> bool:
    faulty = {name for name in NAMES if name.startswith("short_" if kind == "short" else kind)}
    return any(called for name, called in zip(NAMES, result["degraded"], strict=True) if name in faulty)


def unlike_table(outcomes: Outcomes) -> str:
    """Return a table of the outcomes of foreign and spoilt recordings, and of the answering methods."""
    answered = "answered by the network alone, by least squares from it, by the full search"
    columns = (*OUTCOMES, NOT_TAKEN)
    rows = []
    for group in ("foreign", "spoilt"):
        for label in dict.fromkeys(c.label for c, _, _ in outcomes if c.group == group):
            for method in (*METHODS, WITHOUT_SEARCH):
                results = _results(outcomes, group, method, label)
                if not results:
                    continue
                tally = Counter(r["outcome"] for r in results)
                by = Counter(r.get("method") for r in results)
                wrong = sorted(r["error"] for r in results if r["outcome"] == UNDETECTED_ERROR)
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
    """Return a table of the network's computing time on one core, for single recordings and batches."""
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
    header = ("recordings per batch", "processor time per recording, ms", "recordings per second")
    return markdown_table(header, table, words=0)


def _percent(values: Sequence[bool] | Flags) -> str:
    """Return the share of true `values`, a dash if there are none, as for a group that was left out."""
    if not len(values):
        return NOTHING
    return f"{100 * float(np.mean(values)):.1f} %"
