"""Figures on pages: all entries of the legend and all results are drawn."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
from matplotlib.colors import to_hex

from emaphm.detection.result import Contribution, DetectorResult
from emaphm.plotting.detection import draw_detected_sets, draw_detection
from emaphm.plotting.limits import draw_limits
from emaphm.study.analysis.limits import SettingRates
from emaphm.study.plan import PageRow, PageSection
from emaphm.text_table import with_digits

RESULT = DetectorResult(
    recording="today.csv",
    cycles=1,
    cycles_alarming=1,
    level_cycles=1,
    manoeuvre="ramp",
    t2=3.0,
    q=1.0,
    t2_threshold=1.0,
    q_threshold=1.0,
    contributions=(
        Contribution("current_A", "up, 0 to 1 s", "up", "mean", 2.0, 0.5),
        Contribution("current_A", "down, 1 to 2 s", "down", "mean", 1.0, 0.5),
    ),
    nearest=None,
    false_alarm_rate=0.01,
    shown="",
)


def _result(q: float, t2: float) -> DetectorResult:
    """Return a detector's result with the fields that a figure of sets uses."""
    return cast("DetectorResult", SimpleNamespace(q=q, t2=t2, q_threshold=1.0, t2_threshold=1.0))


def test_results_of_zero_are_drawn_below_all_others_with_an_axis_label() -> None:
    (axis,) = draw_detected_sets({"still": [_result(0.0, 0.0)], "moved": [_result(1.0, 2.0)]}).axes
    still, moved = axis.get_lines()[:2]
    assert (np.asarray(still.get_xdata())[0], np.asarray(still.get_ydata())[0]) == (0.1, 0.2)
    assert (np.asarray(moved.get_xdata())[0], np.asarray(moved.get_ydata())[0]) == (1.0, 2.0)
    assert axis.get_xlabel() == "Q / threshold, 0 at 0.1"
    assert axis.get_ylabel() == "T² / threshold, 0 at 0.2"
    (axis,) = draw_detected_sets({"moved": [_result(1.0, 2.0)]}).axes
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("Q / threshold", "T² / threshold")


def test_the_threshold_is_inside_the_figure_however_distant_the_recording_is() -> None:
    for t2, q in ((2000.0, 0.0), (0.8, 0.02)):
        result = replace(RESULT, t2=t2, q=q)
        axis = draw_detection(result).axes[0]
        (threshold,) = (line for line in axis.get_lines() if line.get_linestyle() == "--")
        low, high = axis.get_ylim()
        assert low < np.asarray(threshold.get_ydata())[0] < high
        assert {text.get_text() for text in axis.texts} == {with_digits(t2), f"{q:g}"}
    # Each segment is named in full at its place, also for a single channel.
    assert {"up, 0 to 1 s", "down, 1 to 2 s"} == {
        text.get_text() for text in draw_detection(RESULT).axes[1].get_yticklabels()
    }


def test_all_methods_of_a_section_are_drawn_with_distinct_styles() -> None:
    methods = [f"method {i}" for i in range(20)]
    rows = tuple(PageRow(text="a", rig="base", method=method) for method in methods)
    rates = SettingRates(1.0, 2.0, 0.95, 0.9, "gain", 1.0, 0.5, 0.01, 20)
    figure = draw_limits(PageSection(title="All", label="setting", rows=rows), dict.fromkeys(rows, rates))
    # The median and the 95th percentile differ by their dashes, the methods by colour and marker.
    lines = figure.axes[0].get_lines()
    looks = {(to_hex(line.get_color()), line.get_marker(), line.get_linestyle()) for line in lines}
    assert len(lines) == len(looks) == 2 * 20
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["median", "95th percentile", *methods]
