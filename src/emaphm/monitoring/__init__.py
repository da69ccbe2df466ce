"""Online monitoring: diagnosis of recordings as they arrive, with alarms, prognoses and events."""

from emaphm.monitoring.ownership import NamePattern, Ownership
from emaphm.monitoring.settings import WATCH, WatchSettings
from emaphm.monitoring.task import WatchTask
from emaphm.monitoring.watch import Watching, watch

__all__ = ["WATCH", "NamePattern", "Ownership", "WatchSettings", "WatchTask", "Watching", "watch"]
