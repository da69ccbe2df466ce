"""Catalogue of the models by name."""

from emaphm.errors import MethodError, nearest
from emaphm.simulation.engine.model import Model
from emaphm.simulation.models.averaged import AVERAGED
from emaphm.simulation.models.monitor import monitor
from emaphm.simulation.models.reference import REFERENCE

MODELS = {"reference": REFERENCE, "monitor": monitor(), "averaged": AVERAGED}
"""Models by the names of the command line."""


def model_named(name: str) -> Model:
    """Return the model called `name`; raise `MethodError` with the nearest name if there is none."""
    if name not in MODELS:
        raise MethodError(f"unknown model '{name}'{nearest(name, MODELS)}")
    return MODELS[name]
