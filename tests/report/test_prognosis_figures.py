"""Figures of a prognosis: intervals can be seen, of one forecast too."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from emaphm.actuator import Actuator
from emaphm.plotting.prognosis import draw_fan
from emaphm.prognosis import Evidence, prognose
from emaphm.prognosis.keeping import Curves
from emaphm.report.prognosis import write_prognosis

FIRST = (100.0, 200.0, 350.0, 500.0, 700.0, 900.0)
SECOND = (200.0, 150.0, 300.0, 450.0, 600.0, 800.0)


def curves(*fan: tuple[float, ...]) -> Curves:
    """Return those of a unit with these forecasts; a fan shows nothing else."""
    return Curves("S1", fan[-1][0], 200.0, 4000.0, (), (), {}, (), (), (), (), "", fan)


def spans(axis: Axes) -> dict[str, tuple[float, float]]:
    """Return the least and the largest RUL that is drawn of each interval, by its label."""
    found = {}
    for drawn in axis.collections:
        heights = np.concatenate([np.asarray(path.vertices)[:, 1] for path in drawn.get_paths()])
        found[str(drawn.get_label())] = (float(heights.min()), float(heights.max()))
    return found


def test_the_intervals_of_one_forecast_are_bars_as_wide_as_a_line() -> None:
    figure = draw_fan(curves(FIRST))
    (axis,) = figure.axes
    assert spans(axis) == {"90 %": (200.0, 900.0), "50 %": (350.0, 700.0)}
    figure.draw_without_rendering()
    low, high = axis.get_ylim()
    assert low == 0.0
    assert high > 900.0
    assert all(np.all(np.asarray(drawn.get_linewidth()) == 8.0) for drawn in axis.collections)


def test_the_intervals_of_several_forecasts_are_bands() -> None:
    (axis,) = draw_fan(curves(FIRST, SECOND)).axes
    assert spans(axis) == {"90 %": (150.0, 900.0), "50 %": (300.0, 700.0)}
    for drawn in axis.collections:
        hours = np.concatenate([np.asarray(path.vertices)[:, 0] for path in drawn.get_paths()])
        assert (hours.min(), hours.max()) == (100.0, 200.0)


@pytest.mark.usefixtures("few_paths", "undrawn_prognosis")
@pytest.mark.parametrize(
    ("hours", "text"), [(200.0, "200 h"), (1234.5, "1,234.5 h"), (1236300.0, "1,236,300 h")]
)
def test_a_report_is_named_after_all_digits_of_the_hours(tmp_path: Path, hours: float, text: str) -> None:
    page = tmp_path / "page.html"
    write_prognosis(prognose(Evidence("S1", "P1", hours), Actuator.thesis()), page)
    assert f"<h1>S1 at {text}</h1>" in page.read_text(encoding="utf-8")
