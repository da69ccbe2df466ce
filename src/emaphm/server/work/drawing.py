"""Figures as SVG, drawn in a separate process, so that pages do not wait, and cached in memory."""

import threading
from collections import OrderedDict
from typing import Any

from emaphm.errors import ServerError
from emaphm.execution.one_process import Calls, EndedError
from emaphm.server.settings import ServerSettings

Key = tuple[Any, ...]


def drawn(name: str, document: dict[str, Any], *, narrow: bool = False) -> bytes:
    """Return a figure of a prognosis ("health", "life", "fan"), or "faults" of a diagnosis, as SVG.

    `narrow` selects the layout for a phone.
    """
    from emaphm.plotting import fault_intervals, prognosis
    from emaphm.plotting.svg import plain_style, svg

    with plain_style():
        if name == "faults":
            return svg(fault_intervals.draw_components(estimates(document)))
        from emaphm.prognosis.keeping import Curves

        draw = {"health": prognosis.draw_health, "life": prognosis.draw_life, "fan": prognosis.draw_fan}[name]
        return svg(draw(Curves.from_dict(document), narrow=narrow))


def estimates(document: dict[str, Any]) -> dict[str, Any]:
    """Return the components of a stored diagnosis as `emaphm.diagnosis.Estimate`, by name."""
    from emaphm.diagnosis import Estimate

    result = {}
    for name, fault in document["faults"].items():
        low, high = fault["interval95"]
        limits = (min(low, 0.0), max(high, 1.0)) if name == "friction" else (0.0, 1.0)
        result[name] = Estimate(
            fault["value"],
            fault["standard_error"],
            (low, high),
            fault["identifiable"],
            fault["verdict"],
            fault.get("reason", ""),
            limits,
        )
    return result


class Drawer:
    """Draws figures, one at a time, and caches the most recently used."""

    def __init__(self, settings: ServerSettings) -> None:
        self._settings = settings
        self._cached: OrderedDict[Key, bytes] = OrderedDict()
        self._lock = threading.Lock()
        self._calls = Calls(settings.drawing_seconds, settings.worker_bytes)

    def figure(self, key: Key, name: str, document: dict[str, Any], *, narrow: bool = False) -> bytes:
        """Return the figure `name` of `document`; the same `key` gives the same figure.

        Raises
        ------
        ServerError
            The figure cannot be drawn, or not in time.
        """
        with self._lock:
            if key in self._cached:
                self._cached.move_to_end(key)
                return self._cached[key]
        try:
            content = self._calls(drawn, name, document, narrow=narrow)
        except EndedError:
            raise ServerError("the figure was not drawn in time; load the page again") from None
        with self._lock:
            self._cached[key] = content
            while sum(map(len, self._cached.values())) > self._settings.figures_bytes:
                self._cached.popitem(last=False)
        return content

    def stop(self) -> None:
        """End the process."""
        self._calls.end()
