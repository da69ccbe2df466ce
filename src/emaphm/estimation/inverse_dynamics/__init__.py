"""Inverse dynamics: identification of parameters from measured motion and torque, without the controller."""

from emaphm.estimation.inverse_dynamics.controller_check import ControllerCheck, controller_check
from emaphm.estimation.inverse_dynamics.fit import inverse_dynamics
from emaphm.estimation.inverse_dynamics.result import ForceReplay, InverseDynamicsResult

__all__ = [
    "ControllerCheck",
    "ForceReplay",
    "InverseDynamicsResult",
    "controller_check",
    "inverse_dynamics",
]
