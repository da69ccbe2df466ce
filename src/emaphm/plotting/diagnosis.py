"""Figures of a diagnosis: recorded and modelled current, residual, and a page with both and the faults."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import Faults
from emaphm.plotting.external_load import draw_load_axis
from emaphm.plotting.fault_intervals import draw_fault_intervals
from emaphm.plotting.style import (
    FAINT,
    PAGE_WIDTH,
    PHONE_WIDTH,
    RECORDED,
    RESIDUAL,
    legend_beside_title,
    new_figure,
    style_axis,
)
from emaphm.plotting.time_series import draw_line, draw_recorded_and_model, title_with_recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from emaphm.diagnosis.result import Diagnosis

ZOOM_SHARE = 0.1
"""Share of the recording in the zoom."""

SEGMENT = 4096
"""Rows in each segment of the spectrum (Welch's method), or half the recording if that is shorter."""


def draw_diagnosis(diagnosis: "Diagnosis", truth: Faults | None = None) -> "Figure":
    """Return the page of current, residual, zoom, spectrum, faults and, if estimated, the varying load.

    Parameters
    ----------
    truth
        The true faults, if known, drawn as open markers.
    """
    load = diagnosis.load
    figure = new_figure(PAGE_WIDTH, 10 if load is None else 11.6)
    halves = figure.subfigures(2, 1, squeeze=False, height_ratios=(2, 1) if load is None else (2.5, 1))
    above, below = halves[:, 0]
    layout = [["current", "current"], ["residual", "residual"], ["zoom", "spectrum"]]
    heights = [1.3, 0.8, 1.1]
    if load is not None:
        layout, heights = [*layout, ["load", "load"]], [*heights, 0.8]
    axes = above.subplot_mosaic(layout, height_ratios=heights)
    if load is not None:
        draw_load_axis(axes["load"], diagnosis, load)
    _current(axes["current"], diagnosis)
    _residual(axes["residual"], diagnosis)
    _zoom(axes["zoom"], diagnosis)
    _spectrum(axes["spectrum"], diagnosis)
    above.align_ylabels([axes["current"], axes["residual"], axes["zoom"]])
    draw_fault_intervals(below, diagnosis.components, truth)
    title_with_recording(figure, diagnosis.recording, diagnosis.actuator)
    return figure


def draw_fit(diagnosis: "Diagnosis") -> "Figure":
    """Return the figure of recorded and modelled current, and a zoom at the largest residual."""
    figure = new_figure(PHONE_WIDTH, 4.4)
    full, zoom = figure.subplots(2, 1)
    _current(full, diagnosis)
    _zoom(zoom, diagnosis)
    figure.align_ylabels()
    return figure


def draw_residual(diagnosis: "Diagnosis") -> "Figure":
    """Return the figure of the residual over time, and of its spectrum with that of the current."""
    figure = new_figure(PHONE_WIDTH, 4.2)
    residual, spectrum = figure.subplots(2, 1)
    _residual(residual, diagnosis)
    _spectrum(spectrum, diagnosis)
    figure.align_ylabels()
    return figure


def _current(axis: "Axes", diagnosis: "Diagnosis") -> None:
    draw_recorded_and_model(axis, diagnosis.time_s, diagnosis.recorded, diagnosis.modelled)
    shaded = diagnosis.time_s[_worst_rows(diagnosis)]
    axis.axvspan(shaded[0], shaded[-1], color=FAINT, alpha=0.25, linewidth=0)
    style_axis(axis, "Current", "time [s]", "equivalent current [A]")
    legend_beside_title(axis)


def _zoom(axis: "Axes", diagnosis: "Diagnosis") -> None:
    rows = _worst_rows(diagnosis)
    draw_recorded_and_model(axis, diagnosis.time_s[rows], diagnosis.recorded[rows], diagnosis.modelled[rows])
    style_axis(axis, "Shaded part: largest residual", "time [s]", "equivalent current [A]")


def _worst_rows(diagnosis: "Diagnosis") -> slice:
    """Return the rows of the share `ZOOM_SHARE` with the largest rms residual."""
    squares = (diagnosis.recorded - diagnosis.modelled) ** 2
    length = max(round(ZOOM_SHARE * squares.size), 2)
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    start = int(np.argmax(sums[length:] - sums[:-length]))
    return slice(start, start + length)


def _residual(axis: "Axes", diagnosis: "Diagnosis") -> None:
    draw_line(axis, diagnosis.time_s, diagnosis.recorded - diagnosis.modelled, RESIDUAL)
    size = f"{diagnosis.residual_rms_A:.3g} A rms, {100 * diagnosis.relative_residual:.1f} % of the current"
    style_axis(axis, f"Residual (recorded minus model): {size}", "time [s]", "residual [A]")


def _spectrum(axis: "Axes", diagnosis: "Diagnosis") -> None:
    """Draw the amplitude densities of current and residual, i.e. the frequencies of model errors."""
    from scipy.signal import welch

    time = diagnosis.time_s
    rate = (time.size - 1) / (time[-1] - time[0])
    signals = {
        "recorded": (diagnosis.recorded, RECORDED),
        "residual": (diagnosis.recorded - diagnosis.modelled, RESIDUAL),
    }
    for label, (values, colour) in signals.items():
        frequency, power = welch(values, rate, nperseg=min(time.size // 2, SEGMENT))
        if np.any(power[1:] > 0):
            axis.loglog(frequency[1:], np.sqrt(power[1:]), color=colour, linewidth=1, label=label)
    style_axis(axis, "Spectrum", "frequency [Hz]", "amplitude density [A/√Hz]")
    legend_beside_title(axis)
