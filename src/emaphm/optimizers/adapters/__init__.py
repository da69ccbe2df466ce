"""Optimisers of other libraries as `Minimiser`; a library is imported when its optimiser is made."""

from emaphm.optimizers.adapters.by_name import PEERS, is_peer, peer

__all__ = ["PEERS", "is_peer", "peer"]
