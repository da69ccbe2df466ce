"""Execution of the study of spoilt recordings: one task per recording; it is resumable."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator, Faults
from emaphm.diagnosis import diagnose
from emaphm.errors import EmaphmError, StudyError, nearest
from emaphm.execution import OnTask, Task, run_tasks
from emaphm.execution.revision import check_revision
from emaphm.execution.store import ResultStore
from emaphm.output_files import make_folder
from emaphm.random_streams import stream
from emaphm.recording import Recording
from emaphm.study.spoilt.classes import CLASSES, SpoiltClass
from emaphm.study.spoilt.judging import judged, refused
from emaphm.study.spoilt.revision import revision
from emaphm.study.spoilt.source import CHANNELS, FAULTS, recorded

RESULTS = "results.sqlite"


@dataclass(frozen=True)
class SpoiltCase:
    """One recording: the names of its class, set of channels and true faults, and its seed."""

    spoilt_class: str
    channels: str
    faults: str
    seed: int

    @property
    def name(self) -> str:
        """Name of the case in messages."""
        return f"{self.spoilt_class}, {self.channels}, {self.faults}"


CLASS_NAMED = {spoilt_class.name: spoilt_class for spoilt_class in CLASSES}


def cases(share: float = 1.0, only: str | None = None) -> tuple[SpoiltCase, ...]:
    """Return the cases: each class with its sets of channels and all faults, or the first `share` of them.

    Parameters
    ----------
    share
        Share of the faults to use, in (0, 1]; at least one fault.
    only
        A group of classes, or one class; by default all classes.

    Raises
    ------
    StudyError
        The share is outside of its range, or the class is unknown.
    """
    if not 0 < share <= 1:
        raise StudyError(f"a share of {share:g} cannot be taken; give more than 0, up to 1")
    chosen = [candidate for candidate in CLASSES if only in (None, candidate.name, candidate.group)]
    if not chosen:
        known = {candidate.group for candidate in CLASSES} | set(CLASS_NAMED)
        raise StudyError(f"unknown class of spoilt recordings '{only}'{nearest(str(only), known)}")
    faults = list(FAULTS)[: max(1, round(share * len(FAULTS)))]
    return tuple(
        SpoiltCase(spoilt_class.name, channels, name, seed)
        for spoilt_class in chosen
        for channels in spoilt_class.sets
        for seed, name in enumerate(faults)
    )


def spoilt(case: SpoiltCase) -> tuple[Recording, Actuator, Faults]:
    """Return the spoilt recording, the description for the diagnosis, and the true faults.

    Raises
    ------
    EmaphmError
        The spoilt recording or description is no longer valid.
    """
    true, spoilt_class = Actuator.thesis(), CLASS_NAMED[case.spoilt_class]
    faults = FAULTS[case.faults]
    clean = recorded(true, faults, spoilt_class.manoeuvre, CHANNELS[case.channels], case.seed)
    columns = spoilt_class.change(clean.channels, stream(case.seed, "spoilt recordings", case.name))
    return Recording(columns, clean.sampling, case.name), spoilt_class.described(true), faults


def perform(case: SpoiltCase, expected: str) -> dict[str, Any]:
    """Return the outcome of one case (`emaphm.study.spoilt.judging`).

    Raises
    ------
    StudyError
        The code of this process differs from that of revision `expected`.
    """
    check_revision(revision(), expected, "study", StudyError)
    try:
        recording, actuator, truth = spoilt(case)
        return judged(diagnose(recording, actuator, seed=case.seed, workers=1), truth)
    except EmaphmError as error:
        return refused(str(error))


def tasks(chosen: tuple[SpoiltCase, ...]) -> list[Task]:
    """Return the tasks of the cases; results of another version of the models have different keys."""
    expected = revision()
    return [
        Task(i, perform, (case, expected), _key(case, expected), case.name) for i, case in enumerate(chosen)
    ]


def _key(case: SpoiltCase, expected: str) -> str:
    return hashlib.sha256(repr((case, expected)).encode()).hexdigest()


def run(
    folder: str | Path,
    chosen: tuple[SpoiltCase, ...],
    *,
    workers: int | None = None,
    on_task: OnTask | None = None,
) -> None:
    """Run the cases whose results are missing in `folder`, in processes of this machine.

    Raises
    ------
    StudyError
        Some cases failed because of a defect; results of the others are stored.
    ExecutionError, OutputError
        The workers or the file of results cannot be used; finished results are stored.
    """
    make_folder(Path(folder))
    failures = run_tasks(tasks(chosen), ResultStore(Path(folder) / RESULTS), workers=workers, on_task=on_task)
    if failures:
        raise StudyError(f"{len(failures)} of {len(chosen)} cases failed, the first: {failures[0]}")


def results(folder: str | Path, chosen: tuple[SpoiltCase, ...]) -> dict[SpoiltCase, dict[str, Any]]:
    """Return the finished results of the cases in `folder`, computed by this version of the models."""
    done, _ = ResultStore(Path(folder) / RESULTS).read(tasks(chosen))
    return {chosen[i]: outcome.result for i, outcome in sorted(done.items())}


def class_of(case: SpoiltCase) -> SpoiltClass:
    """Return the class of a case."""
    return CLASS_NAMED[case.spoilt_class]
