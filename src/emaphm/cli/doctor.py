"""The verb `doctor`: the installed versions and the environment."""

from emaphm.cli.options import AsJson
from emaphm.cli.output import show


def doctor(*, as_json: AsJson = False) -> None:
    """Show versions, processor cores, the cache of compiled kernels, and the installed extras."""
    from emaphm.environment import environment

    result = environment()
    show(result.to_dict(), str(result), as_json)
