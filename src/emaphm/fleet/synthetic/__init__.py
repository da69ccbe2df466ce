"""Synthetic fleet with its ground truth, and its processing chain. No unit of it exists."""

from emaphm.fleet.synthetic.chain import Chain, run_chain
from emaphm.fleet.synthetic.folder import FleetFolder
from emaphm.fleet.synthetic.plan import FleetPlan
from emaphm.fleet.synthetic.prediction import prognoses
from emaphm.fleet.synthetic.unit import SyntheticUnit, drawn_unit

__all__ = ["Chain", "FleetFolder", "FleetPlan", "SyntheticUnit", "drawn_unit", "prognoses", "run_chain"]
