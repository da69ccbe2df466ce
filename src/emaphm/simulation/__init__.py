"""Simulation of the actuator: its laws, the reference, monitor and averaged models, and their execution."""

from emaphm.simulation.engine.inputs import Inputs
from emaphm.simulation.engine.model import OBSERVABLE, Initial, Model
from emaphm.simulation.engine.plant import Plant
from emaphm.simulation.engine.running import observe_batch, run, simulate_batch
from emaphm.simulation.models.averaged import AVERAGED
from emaphm.simulation.models.catalogue import MODELS, model_named
from emaphm.simulation.models.monitor import monitor
from emaphm.simulation.models.reference import REFERENCE

__all__ = [
    "AVERAGED",
    "MODELS",
    "OBSERVABLE",
    "REFERENCE",
    "Initial",
    "Inputs",
    "Model",
    "Plant",
    "model_named",
    "monitor",
    "observe_batch",
    "run",
    "simulate_batch",
]
