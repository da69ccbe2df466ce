"""The reference model: three phases, every switching of the inverter, a step a microsecond."""

from emaphm.simulation.engine.model import Model
from emaphm.simulation.models.foc import FOC
from emaphm.simulation.models.hysteresis_bldc import HYSTERESIS_BLDC
from emaphm.simulation.models.six_step import SIX_STEP

REFERENCE = Model(
    "reference", 1e-6, {"hysteresis": HYSTERESIS_BLDC, "six-step": SIX_STEP, "foc": FOC}, switches=True
)
"""The reference model at its step of 1 µs."""
