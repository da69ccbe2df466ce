"""`emaphm doctor`: what is installed."""

from emaphm.cli.options import AsJson
from emaphm.cli.output import show


def doctor(*, as_json: AsJson = False) -> None:
    """Say versions, cores, the cache of compiled kernels, and which extras are there."""
    from emaphm.environment import environment

    found = environment()
    show(found.to_dict(), str(found), as_json)
