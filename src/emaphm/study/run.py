"""Running a study: what is missing is done, on this machine or a cluster, and kept as it finishes."""

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from emaphm.errors import StudyError
from emaphm.study.plan import Plan, Task
from emaphm.study.store import Store
from emaphm.study.task import Outcome

OnRun = Callable[[int, int], None]
"""Told after each run: how many are done, of how many."""


def run_study(
    plan: Plan,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    mix: bool = False,
    on_run: OnRun | None = None,
) -> Store:
    """Do what is missing of `plan` in `folder`, and return its store with every result.

    Results do not depend on the number of workers, on where they are, or on interruptions. The store's
    `damaged` are the parts that were not whole; their runs have been done again.

    Parameters
    ----------
    workers
        Processes on this machine; one a core where left out.
    scheduler
        Address of a Dask scheduler, e.g. ``tcp://10.0.0.1:8786``, to run on its workers instead.
    mix
        Whether results of another version of the models, in the folder already, may stand.
    on_run
        Called at the start and after each run.

    Raises
    ------
    StudyError
        The folder or the scheduler cannot be used, or some runs failed; those that did not are kept.
    """
    store = Store.create(folder, plan, mix=mix)
    with store.locked():
        store = Store.create(folder, plan, mix=mix)  # another study may have added to it meanwhile
        store.prepare()
        done = set(store.results["index"])
        tasks = plan.tasks
        missing = [task for task in tasks if task.index not in done]
        failures = []
        if on_run:
            on_run(len(done), len(tasks))
        with closing(_outcomes(plan, missing, workers, scheduler)) as outcomes:
            for outcome in outcomes:
                if outcome.row is None:
                    failures.append(outcome.failure)
                    continue
                store.add(outcome.row)
                done.add(outcome.index)
                if on_run:
                    on_run(len(done), len(tasks))
    if failures:
        raise StudyError(
            f"{len(failures)} of {len(missing)} runs failed, the first: {failures[0]}; "
            f"what finished is kept in {folder}"
        )
    return replace(Store.open(folder), damaged=store.damaged)


def _outcomes(
    plan: Plan, tasks: Sequence[Task], workers: int | None, scheduler: str | None
) -> Generator[Outcome]:
    if not tasks:
        return
    if scheduler is None:
        from emaphm.execution.processes import run_locally

        yield from run_locally(plan, tasks, workers)
    else:
        from emaphm.execution.dask_cluster import run_on_cluster

        yield from run_on_cluster(plan, tasks, scheduler)
