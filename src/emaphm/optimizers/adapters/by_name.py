"""Optimisers of other libraries by their names on the command line."""

from collections.abc import Callable
from typing import Any

from emaphm.errors import MethodError, nearest
from emaphm.optimizers.adapters.cma_es import CmaEs
from emaphm.optimizers.adapters.l_shade import LShade
from emaphm.optimizers.adapters.pymoo_algorithms import PREFIX, Pymoo, check_algorithm
from emaphm.optimizers.adapters.scipy_de import ScipyDE
from emaphm.optimizers.minimiser import Minimiser

PEERS: dict[str, type[Minimiser]] = {"cma-es": CmaEs, "l-shade": LShade, "scipy-de": ScipyDE}
"""Optimisers by name; the names of pymoo's algorithms are ``pymoo-`` and pymoo's own name."""


def is_peer(name: str) -> bool:
    """Return whether `name` is that of another library's optimiser; any name after ``pymoo-`` counts."""
    return name in PEERS or name.startswith(PREFIX)


def peer(name: str) -> Callable[..., Minimiser]:
    """Return a function that makes the optimiser from `lower`, `upper`, `population` and `iterations`.

    Raises
    ------
    MethodError
        The name is unknown. The returned function raises it if the library is not installed.
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
