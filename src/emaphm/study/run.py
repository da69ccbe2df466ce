"""Running a study: what is missing is done, on this machine or a cluster, and kept as it finishes."""

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
    """Do what is missing of `plan` in `folder`, and return its store with every result.

    Results do not depend on the number of workers, on where they are, or on interruptions. The store's
    `damaged` are the trials whose rows were damaged; they have been done again.

    Parameters
    ----------
    share
        Share of the trials to do now, in (0, 1]: the first of each kind. The folder is the whole plan's, so
        that a later call goes on with the others.
    workers
        Processes on this machine; one a core where left out.
    scheduler
        Address of a Dask scheduler, e.g. ``tcp://10.0.0.1:8786``, to run on its workers instead.
    mix
        Whether results of another version of the models, in the folder already, may stand.
    on_run
        Called at the start and after each trial: how many are done, of how many.

    Raises
    ------
    StudyError
        The folder cannot be used, or some trials failed; those that did not are kept.
    ExecutionError, OutputError
        The workers, the scheduler or the file of results cannot be used; what finished is kept.
    """
    asked = tasks(plan, trials_of(plan, share))
    check_workers(scheduler)
    store = Store.create(folder, plan, mix=mix)
    with store.locked():
        store = Store.create(folder, plan, mix=mix)  # another study may have added to it meanwhile
        store.clear()
        done = set(store.results["index"])
        failures = run_tasks(asked, store.kept, workers=workers, scheduler=scheduler, on_task=on_run)
    if failures:
        missing = sum(task.index not in done for task in asked)
        raise StudyError(
            f"{len(failures)} of {missing} runs failed, the first: {failures[0]}; "
            f"what finished is kept in {folder}"
        )
    return replace(Store.open(folder), damaged=store.damaged)
