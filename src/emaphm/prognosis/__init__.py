"""How long a unit will last: requirements, degradation, remaining useful life, metrics, advice."""
