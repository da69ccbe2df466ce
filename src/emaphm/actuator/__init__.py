"""Description of the actuator: parameters, faults and commands, without simulation."""

from emaphm.actuator.actuator import Actuator
from emaphm.actuator.commands import Chirp, Command, DecayingChirp, Load, Ramp, Sampled, Sine, Step
from emaphm.actuator.faults import COMPONENTS, NAMES, Faults

__all__ = [
    "COMPONENTS",
    "NAMES",
    "Actuator",
    "Chirp",
    "Command",
    "DecayingChirp",
    "Faults",
    "Load",
    "Ramp",
    "Sampled",
    "Sine",
    "Step",
]
