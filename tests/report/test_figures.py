"""Figures: values and units on the axes; matplotlib's settings are unchanged."""

import io
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import PurePath
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from emaphm.actuator import NAMES, Faults
from emaphm.diagnosis import Diagnosis
from emaphm.plotting.diagnosis import draw_diagnosis, draw_fit, draw_residual
from emaphm.plotting.fault_intervals import draw_faults
from emaphm.plotting.replay import draw_replay
from emaphm.plotting.style import BLACK
from emaphm.recording import Recording

PARTS = (draw_fit, draw_residual, draw_faults)


def _points(axis: Axes, marker: str) -> dict[str, float]:
    """Return the values marked by `marker`, by the component of their row."""
    marks = [line for line in axis.get_lines() if line.get_marker() == marker]
    points = [(np.asarray(mark.get_xdata()), np.asarray(mark.get_ydata())) for mark in marks]
    return {NAMES[int(y[0])]: float(x[0]) for x, y in points if x.size}


def _svg(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg")
    return buffer.getvalue()


def _settings() -> dict[str, Any]:
    return {name: mpl.rcParams[name] for name in mpl.rcParams if name != "backend"}


@pytest.mark.parametrize("draw", [draw_diagnosis, draw_faults])
def test_each_figure_is_drawn_without_pyplot_and_leaves_settings_unchanged(
    monkeypatch: pytest.MonkeyPatch, faulty: Diagnosis, draw: Callable[[Diagnosis], Figure]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it now fails
    before = _settings()
    assert _svg(draw(faulty))
    assert _settings() == before


def test_the_fit_is_labelled_and_its_zoom_shows_the_largest_difference(faulty: Diagnosis) -> None:
    complete, zoom = draw_fit(faulty).axes
    assert complete.get_xlabel() == zoom.get_xlabel() == "time [s]"
    assert complete.get_ylabel() == zoom.get_ylabel() == "equivalent current [A]"
    legend = complete.get_legend()
    assert legend
    assert [text.get_text() for text in legend.get_texts()] == ["recorded", "model"]
    first, last = zoom.get_xlim()
    assert first <= 0.300  # the step in the recording begins
    assert 0.319 <= last < first + 0.06  # and ends


def test_the_residual_is_labelled_with_its_size(faulty: Diagnosis) -> None:
    residual, spectrum = draw_residual(faulty).axes
    assert residual.get_ylabel() == "residual [A]"
    assert f"{faulty.residual_rms_A:.3g} A rms" in residual.get_title(loc="left")
    assert (spectrum.get_xlabel(), spectrum.get_ylabel()) == ("frequency [Hz]", "amplitude density [A/√Hz]")


def test_the_spectrum_has_the_power_of_the_current(faulty: Diagnosis) -> None:
    line = draw_residual(faulty).axes[1].get_lines()[0]
    frequency, density = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    power = np.sum(density**2) * (frequency[1] - frequency[0])
    # Parseval; a window over a few periods of the swing leaves a tenth or two of tolerance.
    assert power == pytest.approx(np.var(faulty.recorded), rel=0.2)


def test_faults_are_drawn_in_their_rows_with_healthy_and_true_values(
    faulty: Diagnosis, truth: Faults
) -> None:
    axis = draw_faults(faulty, truth).axes[0]
    assert [tick.get_text() for tick in axis.get_yticklabels()] == list(NAMES)
    assert axis.yaxis_inverted()
    degraded = _points(axis, "s")
    assert degraded == {n: e.value for n, e in faulty.components.items() if e.verdict == "degraded"}
    assert set(_points(axis, "o")) == {"short_a", "short_c"}
    healthy = {name: float(name == "gain") / 2 for name in NAMES if name != "eccentricity_phase"}
    assert _points(axis, "|") == healthy
    assert _points(axis, "D") == {name: getattr(truth, name) for name in NAMES}
    assert axis.texts[0].get_text() == "0.2500  (0.2300 to 0.2700)"


def test_without_truth_nothing_is_marked_as_true(faulty: Diagnosis) -> None:
    assert not _points(draw_faults(faulty).axes[0], "D")


def test_no_true_direction_is_marked_without_eccentricity(faulty: Diagnosis) -> None:
    assert "eccentricity_phase" not in _points(draw_faults(faulty, Faults(friction=0.3)).axes[0], "D")


def test_an_interval_beyond_the_end_of_the_circle_continues_at_the_other_end(faulty: Diagnosis) -> None:
    axis = draw_faults(faulty).axes[0]
    row = NAMES.index("eccentricity_phase")
    lines = [line for line in axis.get_lines() if np.array_equal(line.get_ydata(), [row, row])]
    pieces = sorted(tuple(np.round(np.asarray(line.get_xdata()), 6)) for line in lines)
    assert pieces == [(0.0, 0.03), (0.93, 1.0)]


def test_a_component_that_is_not_identifiable_is_grey_and_labelled(linear: Diagnosis) -> None:
    axis = draw_faults(linear).axes[0]
    for name, tick, text in zip(NAMES, axis.get_yticklabels(), axis.texts, strict=True):
        known = linear.components[name].identifiable
        assert (text.get_text() == "not identifiable") is not known
        assert (tick.get_color() == text.get_color() == BLACK) is known


def test_an_interval_is_printed_although_its_value_is_unknown(faulty: Diagnosis) -> None:
    unknown = replace(faulty.components["friction"], interval95=(0.2, 0.8), identifiable=False)
    axis = draw_faults(replace(faulty, components=dict(faulty.components) | {"friction": unknown})).axes[0]
    assert axis.texts[0].get_text() == "–  (0.2000 to 0.8000)"
    assert "friction" not in _points(axis, "s")


def test_identifiable_but_inconclusive_components_have_their_own_marker_and_label(faulty: Diagnosis) -> None:
    undecided = replace(faulty.components["friction"], verdict="cannot tell")
    figure = draw_faults(replace(faulty, components=dict(faulty.components) | {"friction": undecided}))
    assert _points(figure.axes[0], "d") == {"friction": undecided.value}
    assert "cannot tell" in [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_summary_figure_shows_all_parts(faulty: Diagnosis, truth: Faults) -> None:
    figure = draw_diagnosis(faulty, truth)
    labels = [axis.get_ylabel() for axis in figure.axes]
    parts = [*draw_fit(faulty).axes, *draw_residual(faulty).axes, *draw_faults(faulty).axes]
    assert sorted(labels) == sorted(axis.get_ylabel() for axis in parts)
    assert PurePath(faulty.recording).name in figure.get_suptitle()


def test_a_file_name_is_not_read_as_a_formula_and_leaves_space_for_the_figure(faulty: Diagnosis) -> None:
    source = "folder/" + "long-" * 7 + "a$b^_{c$.csv"
    figure = draw_diagnosis(replace(faulty, recording=source))
    figure.draw_without_rendering()  # raises for an invalid formula
    assert PurePath(source).name in figure.get_suptitle()
    assert len(figure.get_suptitle()) < 100


@pytest.mark.parametrize("draw", PARTS)
def test_a_perfect_model_and_a_dead_current_can_be_drawn(
    faulty: Diagnosis, draw: Callable[[Diagnosis], Figure]
) -> None:
    for current in (faulty.recorded, np.zeros_like(faulty.recorded)):
        perfect = replace(faulty, recorded=current, modelled=current, residual_rms_A=0.0)
        draw(perfect).draw_without_rendering()  # raises for a figure without size or a logarithm of 0


def test_a_long_recording_is_thinned_and_keeps_its_peaks(faulty: Diagnosis) -> None:
    time = np.arange(25_000) / 1e3
    recorded = np.random.default_rng(1).normal(size=time.size)
    recorded[12_345], recorded[20_001] = 9.0, -8.0
    long = replace(faulty, time_s=time, recorded=recorded, modelled=np.zeros_like(recorded))
    figure = draw_fit(long)
    drawn = figure.axes[0].get_lines()[0]
    values = np.asarray(drawn.get_ydata())
    assert values.size < 2000
    assert (values.max(), values.min()) == (9.0, -8.0)
    assert figure.axes[0].get_xlim() == (time[0], time[-1])
    assert len(_svg(figure)) < 500_000


@pytest.mark.parametrize(("coordinates", "angle"), [("rotary", "rad"), ("linear", "m")])
def test_replay_shows_each_channel_in_its_unit_with_its_error(
    faulty: Diagnosis, coordinates: str, angle: str
) -> None:
    time = faulty.time_s
    recording = Recording(
        {
            "time_s": time,
            "command_rad": np.sin(time),
            "position_rad": np.sin(time),
            "angle_rad": np.full(time.size, 3.1),
            "current_A": faulty.recorded,
        }
    )
    signals = {
        "position_rad": 0.98 * np.sin(time),
        "angle_rad": np.full(time.size, 3.1 - 2 * np.pi),
        "current_A": faulty.modelled,
        "speed_rad_s": np.cos(time),
    }
    actuator = faulty.actuator.model_copy(update={"coordinates": coordinates})
    errors = {"position_rad": 0.02, "angle_rad": float("nan"), "current_A": 0.0461}
    axes = draw_replay(recording, signals, actuator, errors).axes
    assert len(axes) == 2 * len(errors)
    assert [axis.get_ylabel() for axis in axes] == [
        f"position of the user [{angle}]",
        f"residual [{angle}]",
        f"angle of the motor [{angle}]",
        f"residual [{angle}]",
        "equivalent current [A]",
        "residual [A]",
    ]
    titles = [axis.get_title(loc="left") for axis in axes[::2]]
    assert titles[0].endswith("relative error 2 %")
    assert "undefined" in titles[1]
    assert titles[2].endswith("relative error 4.61 %")
    turned = np.asarray(axes[3].get_lines()[0].get_ydata())
    np.testing.assert_allclose(turned, 0, atol=1e-12)  # a whole turn apart is no error
    residual = np.asarray(axes[1].get_lines()[0].get_ydata())
    np.testing.assert_allclose(residual, 0.02 * np.sin(time), atol=1e-12)
