"""Importing a library that need not be installed."""

from importlib import import_module
from typing import Any

from emaphm.errors import MethodError


def import_library(what: str, module: str, extra: str) -> Any:
    """Return a `module` of a library that `what` needs, and that the package's `extra` installs.

    Raises
    ------
    MethodError
        The library is not installed.
    """
    name = module.partition(".")[0]
    try:
        import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:  # it is there, but something that it needs is not
            raise
        raise MethodError(
            f"{what} needs the library '{name}'; install it with: pip install 'emaphm[{extra}]'"
        ) from None
    return import_module(module)
