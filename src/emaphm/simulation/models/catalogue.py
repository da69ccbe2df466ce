"""The models by name."""

from emaphm.errors import MethodError, nearest
from emaphm.simulation.engine.model import Model
from emaphm.simulation.models.averaged import AVERAGED
from emaphm.simulation.models.monitor import monitor
from emaphm.simulation.models.reference import REFERENCE

MODELS = {"reference": REFERENCE, "monitor": monitor(), "averaged": AVERAGED}
"""The models by the names that the command line uses."""


def model_named(name: str) -> Model:
    """Return the model of that name; `MethodError` with the nearest name if there is none."""
    if name not in MODELS:
        raise MethodError(f"unknown model '{name}'{nearest(name, MODELS)}")
    return MODELS[name]
