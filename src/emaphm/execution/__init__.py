"""Execution of many independent tasks on processes or a Dask cluster, with stored results and resumption."""

from emaphm.execution.run import OnTask, check_workers, in_order, outcomes, run_missing, run_tasks
from emaphm.execution.store import ResultStore
from emaphm.execution.tasks import Outcome, Task

__all__ = [
    "OnTask",
    "Outcome",
    "ResultStore",
    "Task",
    "check_workers",
    "in_order",
    "outcomes",
    "run_missing",
    "run_tasks",
]
