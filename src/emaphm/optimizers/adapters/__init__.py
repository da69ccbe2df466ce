"""Optimisers of other libraries, called as our own are; a library is imported when its optimiser is made."""

from emaphm.optimizers.adapters.by_name import PEERS, is_peer, peer
from emaphm.optimizers.adapters.cma_es import CmaEs
from emaphm.optimizers.adapters.l_shade import LShade
from emaphm.optimizers.adapters.pymoo_algorithms import Pymoo
from emaphm.optimizers.adapters.scipy_de import ScipyDE

__all__ = [
    "PEERS",
    "CmaEs",
    "LShade",
    "Pymoo",
    "ScipyDE",
    "is_peer",
    "peer",
]
