"""Recordings replayed by a model: how far it is from what was measured."""

from emaphm.estimation.replay.series import write_series
from emaphm.estimation.replay.several import Replays, replay_all
from emaphm.estimation.replay.single import Replay, replay

__all__ = ["Replay", "Replays", "replay", "replay_all", "write_series"]
