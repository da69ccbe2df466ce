"""Execution of a study on this machine or a cluster: missing trials are run, and each result is stored."""

from dataclasses import replace
from pathlib import Path

from emaphm.errors import StudyError
from emaphm.execution import OnTask, check_workers, run_tasks
from emaphm.study.plan import Plan
from emaphm.study.store import Store, tasks
from emaphm.study.trials import trials_of


def run_study(
    plan: Plan,
    folder: str | Path,
    *,
    share: float = 1.0,
    workers: int | None = None,
    scheduler: str | None = None,
    mix: bool = False,
    on_run: OnTask | None = None,
) -> Store:
    """Run the trials of `plan` whose results are missing in `folder`, and return its store with all results.

    Results do not depend on the number of workers, on their machines, or on interruptions. `damaged` of the
    store are the trials whose rows were damaged; they have been run again.

    Parameters
    ----------
    share
        Share of the trials to run now, in (0, 1]: the first of each kind. The folder belongs to the whole
        plan, so that a later call continues with the other trials.
    workers
        Number of processes on this machine; by default one per core.
    scheduler
        Address of a Dask scheduler, e.g. ``tcp://10.0.0.1:8786``, whose workers run the trials instead.
    mix
        Whether results of another version of the models that are already in the folder are kept.
    on_run
        Called at the start and after each trial with the numbers of finished trials and of all trials.

    Raises
    ------
    StudyError
        The folder cannot be used, or some trials failed; results of the others are stored.
    ExecutionError, OutputError
        The workers, the scheduler or the file of results cannot be used; finished results are stored.
    """
    selected = tasks(plan, trials_of(plan, share))
    check_workers(scheduler)
    store = Store.create(folder, plan, mix=mix)
    with store.locked():
        store = Store.create(folder, plan, mix=mix)  # opened again: another process may have added results
        store.clear()
        done = set(store.results["index"])
        failures = run_tasks(selected, store.kept, workers=workers, scheduler=scheduler, on_task=on_run)
    if failures:
        missing = sum(task.index not in done for task in selected)
        raise StudyError(
            f"{len(failures)} of {missing} runs failed, the first: {failures[0]}; "
            f"finished results are stored in {folder}"
        )
    return replace(Store.open(folder), damaged=store.damaged)
