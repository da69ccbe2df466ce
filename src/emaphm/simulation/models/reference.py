"""Reference model: three phases, every switching event of the inverter, a step of 1 µs."""

from dataclasses import replace

from emaphm.simulation.engine.model import Model
from emaphm.simulation.models.averaged import SINGLE_WINDING
from emaphm.simulation.models.foc import FOC
from emaphm.simulation.models.hysteresis_bldc import HYSTERESIS_BLDC
from emaphm.simulation.models.six_step import SIX_STEP

NOT_SWITCHED = {drive: replace(SINGLE_WINDING[drive], longest_step=5e-6) for drive in ("current", "voltage")}
"""Forms for drives without an inverter: the averaged forms, which are exact except for the step, at 5 µs."""

REFERENCE = Model(
    "reference",
    1e-6,
    {"hysteresis": HYSTERESIS_BLDC, "six-step": SIX_STEP, "foc": FOC, **NOT_SWITCHED},
    switches=True,
)
"""Reference model with its step of 1 µs, or 5 µs for drives without an inverter."""
