"""Other libraries' optimisers by the name that they have on the command line."""

from collections.abc import Callable
from typing import Any

from emaphm.errors import MethodError, nearest
from emaphm.optimizers.adapters.cma_es import CmaEs
from emaphm.optimizers.adapters.l_shade import LShade
from emaphm.optimizers.adapters.pymoo_algorithms import (
    PREFIX,
    Pymoo,
    check_algorithm,
    usable_algorithms,
)
from emaphm.optimizers.adapters.scipy_de import ScipyDE
from emaphm.optimizers.minimiser import Minimiser
from emaphm.optional_library import import_library

PEERS: dict[str, type[Minimiser]] = {"cma-es": CmaEs, "l-shade": LShade, "scipy-de": ScipyDE}
"""The optimisers with a name of their own; those of pymoo are called ``pymoo-`` and pymoo's name."""


def is_peer(name: str) -> bool:
    """Return whether `name` is of another library's optimiser; after ``pymoo-`` it may still be unknown."""
    return name in PEERS or name.startswith(PREFIX)


def peer(name: str) -> Callable[..., Minimiser]:
    """Return what makes the optimiser `name` from `lower`, `upper`, `population` and `iterations`.

    Raises
    ------
    MethodError
        The name is unknown; also when the optimiser is made, if its library is not installed.
    """
    if name in PEERS:
        return PEERS[name]
    if not name.startswith(PREFIX):
        raise MethodError(f"unknown method '{name}'{nearest(name, PEERS)}")
    algorithm = name.removeprefix(PREFIX)
    check_algorithm(algorithm)

    def make(**settings: Any) -> Pymoo:
        return Pymoo(algorithm=algorithm, **settings)

    return make


def peer_names() -> tuple[str, ...]:
    """Return the names of `PEERS` and, if pymoo is installed, of its algorithms that can be used.

    The first call takes seconds, as each algorithm is tried.
    """
    try:
        import_library("method 'pymoo'", "pymoo", "peers")
    except MethodError:
        return tuple(PEERS)
    return (*PEERS, *(PREFIX + name for name in usable_algorithms()))
