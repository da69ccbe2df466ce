"""Replay of recordings by a model, and its errors relative to the measured channels."""

from emaphm.estimation.replay.series import write_series
from emaphm.estimation.replay.several import Replays, replay_all
from emaphm.estimation.replay.single import Replay, replay

__all__ = ["Replay", "Replays", "replay", "replay_all", "write_series"]
