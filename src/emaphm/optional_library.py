"""Import of optional libraries."""

from importlib import import_module
from typing import Any

from emaphm.errors import MethodError


def import_library(what: str, module: str, extra: str) -> Any:
    """Return the `module` of an optional library, which the feature `what` needs and the `extra` installs.

    Raises
    ------
    MethodError
        The library is not installed.
    """
    name = module.partition(".")[0]
    try:
        import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:  # the library is installed, but a module that it needs is not
            raise
        raise MethodError(
            f"{what} needs the library '{name}'; install it with: pip install 'emaphm[{extra}]'"
        ) from None
    return import_module(module)
