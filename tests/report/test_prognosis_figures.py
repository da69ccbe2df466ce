"""Figures of a prognosis: intervals are visible, also for a single forecast."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from emaphm.actuator import COMPONENTS, Actuator
from emaphm.plotting.prognosis import draw_fan, draw_health, draw_life
from emaphm.prognosis import Evidence, prognose
from emaphm.prognosis.keeping import Curves
from emaphm.prognosis.keeping.curves import PROBABILITIES, Seen
from emaphm.report.prognosis import write_prognosis

FIRST = (100.0, 200.0, 350.0, 500.0, 700.0, 900.0)
SECOND = (200.0, 150.0, 300.0, 450.0, 600.0, 800.0)


def curves(*fan: tuple[float, ...]) -> Curves:
    """Return the curves of a unit with these forecasts; a fan chart uses only them."""
    return Curves("S1", fan[-1][0], 200.0, 4000.0, (), (), {}, (), (), (), (), "", fan)


def spans(axis: Axes) -> dict[str, tuple[float, float]]:
    """Return the least and the largest drawn RUL of each interval, by its label."""
    by_label = {}
    for drawn in axis.collections:
        heights = np.concatenate([np.asarray(path.vertices)[:, 1] for path in drawn.get_paths()])
        by_label[str(drawn.get_label())] = (float(heights.min()), float(heights.max()))
    return by_label


def test_the_intervals_of_a_single_forecast_are_bars_as_wide_as_a_line() -> None:
    figure = draw_fan(curves(FIRST))
    (axis,) = figure.axes
    assert spans(axis) == {"90 %": (200.0, 900.0), "50 %": (350.0, 700.0)}
    figure.draw_without_rendering()
    low, high = axis.get_ylim()
    assert low == 0.0
    assert high > 900.0
    assert all(np.all(np.asarray(drawn.get_linewidth()) == 8.0) for drawn in axis.collections)


def test_a_unit_with_one_diagnosis_has_bars_though_it_was_forecast_then_and_now_at_the_same_hours() -> None:
    (axis,) = draw_fan(curves(FIRST, FIRST)).axes
    assert spans(axis) == {"90 %": (200.0, 900.0), "50 %": (350.0, 700.0)}
    assert all(np.all(np.asarray(drawn.get_linewidth()) == 8.0) for drawn in axis.collections)


def test_a_single_forecast_after_a_replacement_has_bars() -> None:
    third = (300.0, 250.0, 400.0, 500.0, 650.0, 850.0)
    unit = replace(curves(FIRST, SECOND, third), replacements=((250.0, "friction"),))
    (axis,) = draw_fan(unit).axes
    bars = [drawn for drawn in axis.collections if np.all(np.asarray(drawn.get_linewidth()) == 8.0)]
    ends = [np.asarray(path.vertices) for drawn in bars for path in drawn.get_paths()]
    assert [end.tolist() for end in ends] == [
        [[300.0, 250.0], [300.0, 850.0]],
        [[300.0, 400.0], [300.0, 650.0]],
    ]
    assert axis.get_legend_handles_labels()[1].count("90 %") == 1


@pytest.mark.parametrize("replaced_at", [200.0, 230.0])
def test_the_present_forecast_after_a_replacement_is_not_joined_to_the_old_life(replaced_at: float) -> None:
    """The part is replaced at the hours of the newest diagnosis, or later; no diagnosis has followed."""
    present = (replaced_at, 400.0, 700.0, 900.0, 1100.0, 1500.0)
    unit = replace(curves(FIRST, SECOND, present), replacements=((replaced_at, "friction"),))
    (axis,) = draw_fan(unit).axes
    (median,) = (line for line in axis.get_lines() if line.get_label() == "median")
    hours, ruls = (np.asarray(values, float) for values in median.get_data())
    assert hours.tolist() == [100.0, 200.0, replaced_at, replaced_at]
    np.testing.assert_array_equal(ruls, [500.0, 450.0, np.nan, 900.0])


def test_the_intervals_of_several_forecasts_are_bands() -> None:
    (axis,) = draw_fan(curves(FIRST, SECOND)).axes
    assert spans(axis) == {"90 %": (150.0, 900.0), "50 %": (300.0, 700.0)}
    for drawn in axis.collections:
        hours = np.concatenate([np.asarray(path.vertices)[:, 0] for path in drawn.get_paths()])
        assert (hours.min(), hours.max()) == (100.0, 200.0)


WIDE = (100.0, 260.0, 1800.0, 14000.0, 20000.0, 20000.0)


@pytest.mark.parametrize(
    "last", [(800.0, 60.0, 170.0, 325.0, 470.0, 1160.0), (800.0, 0.0, 0.0, 0.0, 15.0, 40.0)]
)
def test_the_last_forecast_is_readable_next_to_a_very_uncertain_first_one(last: tuple[float, ...]) -> None:
    """Its quantiles differ by at least a twentieth of the axis, unless they are equal."""
    figure = draw_fan(curves(WIDE, last))
    figure.draw_without_rendering()
    (axis,) = figure.axes
    assert "logarithmic" in axis.get_title(loc="left")
    points = axis.transData.transform([(800.0, value) for value in last[1:]])
    heights = axis.transAxes.inverted().transform(points)[:, 1]
    assert np.all((np.diff(heights) > 0.05) | (np.diff(last[1:]) == 0))
    assert np.all((heights >= -1e-9) & (heights <= 1))


def marked(axis: Axes) -> list[float]:
    """Return the hours of the vertical lines of replacements."""
    lines = [line for line in axis.get_lines() if line.get_linestyle() == "-." and np.size(line.get_xdata())]
    return [float(np.asarray(line.get_xdata(), float)[0]) for line in lines]


def test_a_replacement_is_marked_and_interrupts_the_fan_chart() -> None:
    (axis,) = draw_fan(replace(curves(FIRST, SECOND), replacements=((150.0, "friction"),))).axes
    assert marked(axis) == [150.0]
    (median,) = (line for line in axis.get_lines() if line.get_label() == "median")
    assert np.isnan(np.asarray(median.get_ydata(), float)).tolist() == [False, True, False]
    axes = draw_health(replace(falling(800.0), replacements=((400.0, "backlash"),))).axes
    assert {axis.get_title(loc="left") for axis in axes if marked(axis)} == {"backlash"}
    assert "replaced" in axes[0].get_legend_handles_labels()[1]


def falling(now: float, flown: float = 800.0) -> Curves:
    """Return the curves of a unit whose friction falls from 0 to -0.16, and to -0.4 in the next 200 h.

    Its three diagnoses are within the last hours `flown` [h].
    """
    forecast = {name: tuple((0.0, 0.0) for _ in PROBABILITIES) for name in COMPONENTS}
    forecast["friction"] = tuple((-0.16, end) for end in (-0.4, -0.35, -0.3, -0.25, -0.2))
    at = dict.fromkeys(COMPONENTS, 0.0)
    levels = tuple(
        Seen(now - (1 - share) * flown, True, at | {"friction": -0.16 * share}, at)
        for share in (0.0, 0.5, 1.0)
    )
    hours = (now, now + 200.0)
    limits = (("friction", -0.3), ("friction", 0.5))
    return Curves("S1", now, 200.0, 4000.0, levels, hours, forecast, limits, hours, (0.0, 0.5), (), "", ())


def test_limit_and_forecast_of_falling_friction_are_inside_the_figure() -> None:
    axes = {axis.get_title(loc="left"): axis for axis in draw_health(falling(800.0)).axes}
    assert -0.5 < axes["friction"].get_ylim()[0] < -0.4
    assert axes["backlash"].get_ylim()[0] == pytest.approx(-0.03)


@pytest.mark.parametrize(
    ("now", "flown", "narrow"),
    [(800.0, 800.0, True), (15_500.0, 15_500.0, False), (1.23e7, 800.0, True), (1.23e7, 800.0, False)],
)
def test_flight_hours_are_printed_in_full_and_do_not_overlap(now: float, flown: float, narrow: bool) -> None:
    drawn = falling(now, flown)
    for figure in (draw_health(drawn, narrow=narrow), draw_life(drawn, narrow=narrow)):
        figure.draw_without_rendering()
        for axis in figure.axes:
            assert axis.xaxis.get_offset_text().get_text() == ""
            low, high = axis.get_xlim()
            labels = [label for label in axis.get_xticklabels() if low <= label.get_position()[0] <= high]
            assert [float(label.get_text().replace(",", "")) for label in labels] == pytest.approx(
                [label.get_position()[0] for label in labels]
            )
            boxes = [label.get_window_extent() for label in labels if label.get_visible()]
            assert all(left.x1 < right.x0 for left, right in pairwise(boxes))


def test_marks_of_many_diagnoses_are_pixels() -> None:
    few = falling(800.0)
    for curves_of_unit, expected in ((few, False), (replace(few, seen=few.seen * 200), True)):
        axis = draw_health(curves_of_unit).axes[0]
        assert [container[0].get_rasterized() for container in axis.containers] == [expected]


@pytest.mark.usefixtures("few_steps", "undrawn_prognosis")
@pytest.mark.parametrize(
    ("hours", "text"), [(200.0, "200 h"), (1234.5, "1,234.5 h"), (1236300.0, "1,236,300 h")]
)
def test_a_report_is_named_by_all_digits_of_the_hours(tmp_path: Path, hours: float, text: str) -> None:
    page = tmp_path / "page.html"
    write_prognosis(prognose(Evidence("S1", "P1", hours), Actuator.thesis()), page)
    assert f"<h1>S1 at {text}</h1>" in page.read_text(encoding="utf-8")
