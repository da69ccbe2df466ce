"""The reference model: three phases, every switching of the inverter, a step a microsecond."""

from dataclasses import replace

from emaphm.simulation.engine.model import Model
from emaphm.simulation.models.averaged import SINGLE_WINDING
from emaphm.simulation.models.foc import FOC
from emaphm.simulation.models.hysteresis_bldc import HYSTERESIS_BLDC
from emaphm.simulation.models.six_step import SIX_STEP

NOT_SWITCHED = {drive: replace(SINGLE_WINDING[drive], longest_step=5e-6) for drive in ("current", "voltage")}
"""Drives without an inverter: what is averaged over no switching is right but for its step."""

REFERENCE = Model(
    "reference",
    1e-6,
    {"hysteresis": HYSTERESIS_BLDC, "six-step": SIX_STEP, "foc": FOC, **NOT_SWITCHED},
    switches=True,
)
"""The reference model at its step of 1 µs, or 5 µs where no inverter switches."""
