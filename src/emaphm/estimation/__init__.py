"""Parameters from recordings: the objective, the searches for its optimum, and how sure an estimate is."""

from emaphm.estimation.cost_functions import COST_FUNCTIONS
from emaphm.estimation.methods import METHODS
from emaphm.estimation.replay import Replay, replay

__all__ = ["COST_FUNCTIONS", "METHODS", "Replay", "replay"]
