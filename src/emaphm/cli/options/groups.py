"""Groups of options that several verbs share."""

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
    """Options of most verbs: the seed, whether files are replaced, and the format of the answer."""

    seed: Seed = 0
    force: Force = False
    as_json: AsJson = False

    def check(self, *outputs: "tuple[Path | None, tuple[str, ...]]") -> None:
        """Refuse an invalid seed or output; an output is a file with the endings that it may have."""
        check_seed(self.seed)
        for path, endings in outputs:
            check_output(path, endings, force=self.force)

    def show(self, values: dict[str, Any], text: str) -> None:
        """Print the answer as text, or as JSON if --json was given."""
        show(values, text, self.as_json)


@Parameter(name="*")
@dataclass(frozen=True)
class Execution:
    """Where parallel tasks run: in processes of this machine, or on the workers of a Dask scheduler."""

    workers: Workers = None
    scheduler: Scheduler = None

    @property
    def is_given(self) -> bool:
        """Whether --workers or --scheduler was given."""
        return self.workers is not None or self.scheduler is not None

    def check(self) -> None:
        """Refuse a number of workers below 1, and --workers together with --scheduler."""
        if self.workers is not None and self.workers < 1:
            raise ExecutionError(f"--workers {self.workers}: give 1 or more")
        if self.workers is not None and self.scheduler is not None:
            raise ExecutionError(
                "--workers and --scheduler exclude each other: the scheduler has its own workers"
            )
