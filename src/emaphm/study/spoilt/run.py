"""Running the study of spoilt recordings: one task a recording, kept as it finishes, resumed."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from emaphm.actuator import Actuator, Faults
from emaphm.diagnosis import diagnose
from emaphm.errors import EmaphmError, StudyError, nearest
from emaphm.execution import OnTask, Task, run_tasks
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
    """One recording: its class, the set of channels and the true faults, each by name; and its seed."""

    spoilt_class: str
    channels: str
    faults: str
    seed: int

    @property
    def name(self) -> str:
        """What messages call the case."""
        return f"{self.spoilt_class}, {self.channels}, {self.faults}"


CLASS_NAMED = {one.name: one for one in CLASSES}


def cases(share: float = 1.0, only: str | None = None) -> tuple[SpoiltCase, ...]:
    """Return the cases: every class on its sets of channels, with all faults or the first `share` of them.

    Parameters
    ----------
    share
        Share of the faults to take, in (0, 1]; at least one.
    only
        A group of classes, or one class; all where left out.

    Raises
    ------
    StudyError
        The share is outside of its range, or the class is unknown.
    """
    if not 0 < share <= 1:
        raise StudyError(f"a share of {share:g} cannot be taken; give more than 0, up to 1")
    chosen = [one for one in CLASSES if only in (None, one.name, one.group)]
    if not chosen:
        known = {one.group for one in CLASSES} | set(CLASS_NAMED)
        raise StudyError(f"unknown class of spoilt recordings '{only}'{nearest(str(only), known)}")
    faults = list(FAULTS)[: max(1, round(share * len(FAULTS)))]
    return tuple(
        SpoiltCase(one.name, channels, name, seed)
        for one in chosen
        for channels in one.sets
        for seed, name in enumerate(faults)
    )


def spoilt(case: SpoiltCase) -> tuple[Recording, Actuator, Faults]:
    """Return the spoilt recording, the description that the diagnosis is given, and the true faults.

    Raises
    ------
    EmaphmError
        What is spoilt is no recording or no actuator any more.
    """
    true, how = Actuator.thesis(), CLASS_NAMED[case.spoilt_class]
    faults = FAULTS[case.faults]
    clean = recorded(true, faults, how.manoeuvre, CHANNELS[case.channels], case.seed)
    columns = how.change(clean.channels, stream(case.seed, "spoilt recordings", case.name))
    return Recording(columns, clean.sampling, case.name), how.described(true), faults


def perform(case: SpoiltCase, expected: str) -> dict[str, Any]:
    """Return what became of one case (`emaphm.study.spoilt.judging`).

    Raises
    ------
    StudyError
        The code here is not that of revision `expected`.
    """
    if revision() != expected:
        raise StudyError(f"this worker runs another version of the models; install {expected} there")
    try:
        recording, actuator, truth = spoilt(case)
        return judged(diagnose(recording, actuator, seed=case.seed, workers=1), truth)
    except EmaphmError as error:
        return refused(str(error))


def tasks(chosen: tuple[SpoiltCase, ...]) -> list[Task]:
    """Return the tasks of the cases; results of another version of the models have other keys."""
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
    """Do what is missing of the cases in `folder`, on this machine's processes.

    Raises
    ------
    StudyError
        Some cases failed, by a defect; those that did not are kept.
    ExecutionError, OutputError
        The workers or the file of results cannot be used; what finished is kept.
    """
    make_folder(Path(folder))
    failures = run_tasks(tasks(chosen), ResultStore(Path(folder) / RESULTS), workers=workers, on_task=on_task)
    if failures:
        raise StudyError(f"{len(failures)} of {len(chosen)} cases failed, the first: {failures[0]}")


def results(folder: str | Path, chosen: tuple[SpoiltCase, ...]) -> dict[SpoiltCase, dict[str, Any]]:
    """Return what is finished of the cases in `folder`, made by this version of the models."""
    done, _ = ResultStore(Path(folder) / RESULTS).read(tasks(chosen))
    return {chosen[i]: outcome.result for i, outcome in sorted(done.items())}


def class_of(case: SpoiltCase) -> SpoiltClass:
    """Return the class of a case."""
    return CLASS_NAMED[case.spoilt_class]
