"""Options that several verbs share, by subject."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from emaphm.cli.options.single import AsJson, Force, Scheduler, Seed, Workers
from emaphm.cli.options.values import check_output, check_seed
from emaphm.cli.output import show
from emaphm.errors import ExecutionError

if TYPE_CHECKING:
    from pathlib import Path


@Parameter(name="*")
@dataclass(frozen=True)
class Common:
    """What most verbs take last: the seed, whether files are replaced, and how the answer is printed."""

    seed: Seed = 0
    force: Force = False
    as_json: AsJson = False

    def check(self, *outputs: "tuple[Path | None, tuple[str, ...]]") -> None:
        """Refuse a seed or an output that cannot be; an output is a file and the endings that it may have."""
        check_seed(self.seed)
        for path, endings in outputs:
            check_output(path, endings, force=self.force)

    def show(self, values: dict[str, Any], text: str) -> None:
        """Print the answer as it was asked for."""
        show(values, text, self.as_json)


@Parameter(name="*")
@dataclass(frozen=True)
class Execution:
    """Where many tasks run: on processes of this machine, or on the workers of a Dask scheduler."""

    workers: Workers = None
    scheduler: Scheduler = None

    @property
    def is_given(self) -> bool:
        """Whether one of the two was given."""
        return self.workers is not None or self.scheduler is not None

    def check(self) -> None:
        """Refuse numbers of workers that cannot be, and workers together with a scheduler's."""
        if self.workers is not None and self.workers < 1:
            raise ExecutionError(f"--workers {self.workers}: give 1 or more")
        if self.workers is not None and self.scheduler is not None:
            raise ExecutionError(
                "--workers and --scheduler exclude each other: the scheduler has workers of its own"
            )
