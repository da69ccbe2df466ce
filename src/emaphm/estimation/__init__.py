"""Estimation of parameters from recordings: objective, searches for its optimum, and uncertainty."""

from emaphm.estimation.cost_functions import COST_FUNCTIONS
from emaphm.estimation.methods import METHODS
from emaphm.estimation.replay import Replay, Replays, replay, replay_all

__all__ = ["COST_FUNCTIONS", "METHODS", "Replay", "Replays", "replay", "replay_all"]
