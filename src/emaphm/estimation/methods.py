"""Methods of identification by name: `hybrid`, and every optimiser, alone or followed by least squares."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from emaphm.errors import MethodError, nearest
from emaphm.optimizers import OPTIMIZERS, Minimiser
from emaphm.optimizers.adapters import PEERS, is_peer, peer

ABBREVIATIONS = {
    "ga": "genetic",
    "pso": "particle-swarm",
    "de": "differential-evolution",
    "gwo": "grey-wolf",
    "da": "dragonfly",
}
"""Abbreviations of the optimisers in the literature and in the thesis."""

VARIANTS: dict[str, tuple[str, Mapping[str, Any]]] = {
    "dragonfly-thesis": ("dragonfly", {"variant": "thesis"})
}
"""Optimisers with special settings, by a name of their own."""

HYBRID = "hybrid"
WITH_LEAST_SQUARES = "+lsq"

GLOBAL_POPULATION, GLOBAL_ITERATIONS = 32, 8
"""Budget of an optimiser as the global stage of a hybrid; a double budget has no effect (plan "hybrids")."""

METHODS = (HYBRID, *OPTIMIZERS, *VARIANTS, *PEERS)
"""Names of methods without those of pymoo (`pymoo-ga`, …); all except `hybrid` may end in ``+lsq``."""


@dataclass(frozen=True)
class Method:
    """A method of searching for faults.

    `optimizer` is created from lower and upper bounds and searches globally; None stands for space-filling
    points. `least_squares` states whether damped least squares and the bias correction follow.
    """

    name: str
    optimizer: Callable[..., Minimiser] | None
    least_squares: bool

    def prepare(self) -> None:
        """Import and compile the optimiser's dependencies, so that the first search does not take longer."""
        if self.optimizer is not None:
            self.optimizer(np.zeros(2), np.ones(2)).prepare()


def method_named(name: str, settings: Mapping[str, Any] | None = None) -> Method:
    """Return the method `name`, one of `METHODS` or an abbreviation of `ABBREVIATIONS`.

    `settings` replace the optimiser's own, e.g. ``{"population": 30}``.

    Raises
    ------
    MethodError
        The name or a setting is unknown, a setting is impossible, or the required library is not installed.
    """
    settings = dict(settings or {})
    if name == HYBRID:
        if settings:
            raise MethodError(f"method 'hybrid' has no setting '{next(iter(settings))}'; leave it out")
        return Method(HYBRID, None, least_squares=True)
    base, least_squares = name.removesuffix(WITH_LEAST_SQUARES), name.endswith(WITH_LEAST_SQUARES)
    base = ABBREVIATIONS.get(base.lower(), base)
    if least_squares:
        settings = {"population": GLOBAL_POPULATION, "iterations": GLOBAL_ITERATIONS} | settings
    make = _factory(base, name)
    _check_settings(base, make, settings)
    return Method(
        base + WITH_LEAST_SQUARES * least_squares,
        lambda lower, upper: make(lower=lower, upper=upper, **settings),
        least_squares,
    )


def _factory(base: str, given: str) -> Callable[..., Minimiser]:
    """Return the constructor of the optimiser `base`; `given` is the method's name for the error message."""
    if base in OPTIMIZERS:
        return OPTIMIZERS[base]
    if base in VARIANTS:
        kind, preset = VARIANTS[base]
        return lambda **settings: OPTIMIZERS[kind](**{**preset, **settings})
    if is_peer(base):
        return peer(base)
    raise MethodError(f"unknown method '{given}'{nearest(base, (*METHODS, *ABBREVIATIONS))}")


def _check_settings(base: str, make: Callable[..., Minimiser], settings: Mapping[str, Any]) -> None:
    """Raise MethodError for wrong settings before the search begins."""
    box = {"lower": np.zeros(2), "upper": np.ones(2)}
    known = {field.name for field in fields(make(**box)) if field.init} - box.keys()
    for name in settings:
        if name not in known:
            raise MethodError(f"method '{base}' has no setting '{name}'{nearest(name, known)}")
    try:
        make(**box, **settings)
    except TypeError:
        raise MethodError(f"a setting of method '{base}' is of the wrong kind: {settings}") from None
