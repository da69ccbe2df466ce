"""`emaphm doctor` and `emaphm completion`: what is installed, and the shell's help with typing."""

from typing import Annotated, Literal

from cyclopts import Parameter

from emaphm.cli.options import AsJson
from emaphm.cli.output import show


def doctor(*, as_json: AsJson = False) -> None:
    """Say versions, cores, the cache of compiled kernels, and which extras are there."""
    from emaphm.environment import environment

    found = environment()
    show(found.to_dict(), str(found), as_json)


def completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(help="bash, zsh or fish.")],
) -> None:
    """Print what completes the command's verbs and options; for bash: eval "$(emaphm completion bash)"."""
    from emaphm.cli.main import app

    print(app.generate_completion(shell=shell))
