"""Runs on the workers of a Dask scheduler, which may come and go."""

from collections.abc import Iterator, Sequence
from typing import Any

from emaphm.errors import StudyError
from emaphm.study.plan import Plan, Task
from emaphm.study.revision import REVISION
from emaphm.study.task import Outcome, attempt

ANSWER_S = 10.0
"""A scheduler that has not answered by then is not there."""

LOSSES = 20
"""Workers that may be lost under one run before it is blamed for it."""


def run_on_cluster(plan: Plan, tasks: Sequence[Task], address: str) -> Iterator[Outcome]:
    """Yield the outcome of each of `tasks` as it finishes on the Dask scheduler at `address`.

    The runs of a worker that is lost are done again by another.

    Raises
    ------
    StudyError
        Dask is not installed, the scheduler does not answer within ten seconds, or a worker's emaphm is
        another version.
    """
    try:
        import distributed
    except ImportError:
        raise StudyError(
            "--scheduler needs the library 'dask'; install it with: pip install 'emaphm[cluster]'"
        ) from None
    with _client(address) as client:
        futures = client.map(
            attempt,
            [plan.actuator] * len(tasks),
            [plan.manoeuvre] * len(tasks),
            tasks,
            key=[f"emaphm-{REVISION}-{task.index}" for task in tasks],
            pure=False,
            retries=LOSSES,
        )
        for future in distributed.as_completed(futures):
            outcome = future.result()
            future.release()
            if outcome.revision != REVISION:
                raise StudyError(
                    f"the workers of {address} run another version of the models ({outcome.revision}; this "
                    f"is {REVISION}); install the same emaphm there"
                )
            yield outcome


def _client(address: str) -> Any:
    import distributed

    try:
        return distributed.Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise StudyError(
            f"no Dask scheduler answers at {address} ({_first_line(error)}); start one with "
            "'dask scheduler', or leave out --scheduler to use this machine"
        ) from None


def _first_line(error: BaseException) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]
