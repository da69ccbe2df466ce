"""How the actuator moves: the laws, the reference, monitor and averaged models, and running them."""

from emaphm.simulation.averaged import AVERAGED
from emaphm.simulation.inputs import Inputs
from emaphm.simulation.kernels import OBSERVABLE, Initial, Model
from emaphm.simulation.monitor import monitor
from emaphm.simulation.plant import Plant
from emaphm.simulation.reference import REFERENCE
from emaphm.simulation.run import MODELS, model_named, observe_batch, run, run_batch, simulate_batch

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
    "run_batch",
    "simulate_batch",
]
