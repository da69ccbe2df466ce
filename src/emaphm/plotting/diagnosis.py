"""Figures of a diagnosis and of a replay: the current and its model, what is left over, the faults found."""

from collections.abc import Mapping
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.faults import HEALTHY
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.verdict import Estimate
from emaphm.recording import Recording
from emaphm.recording.schema import SCHEMA
from emaphm.simulation.laws.angles import wrap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase

RECORDED, MODELLED, RESIDUAL, FAINT = "0.6", "#d55e00", "#0072b2", "0.55"
"""Told apart by the colour-blind (Okabe and Ito 2008), and in grey print by their lightness."""

VERDICTS = {"healthy": (RESIDUAL, "o"), "degraded": (MODELLED, "s"), "cannot tell": (FAINT, "")}
"""Colour and marker of each verdict; where nobody can tell, there is an interval only."""

WIDTH = 5.6
"""Width of a figure [in]: its 8-point text is still legible on a telephone."""

MOST_BINS = 700
"""Pairs of points in a line: about one a pixel at the width of a page."""

LEGEND: dict[str, Any] = {
    "frameon": False,
    "fontsize": 8,
    "handlelength": 1.4,
    "handletextpad": 0.5,
    "columnspacing": 1.2,
}

ZOOM_SHARE = 0.1
"""Part of the recording that the zoom shows."""


def draw_diagnosis(diagnosis: Diagnosis, truth: Faults | None = None) -> "Figure":
    """Draw all there is to see of `diagnosis` on one page: fit, residual, zoom, spectrum, faults.

    Parameters
    ----------
    diagnosis
        What was found.
    truth
        The true faults, drawn as open markers where they are known.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 10), layout="constrained")
    halves = figure.subfigures(2, 1, squeeze=False, height_ratios=(2, 1))
    above, below = halves[:, 0]
    layout = [["fit", "fit"], ["residual", "residual"], ["zoom", "spectrum"]]
    axes = above.subplot_mosaic(layout, height_ratios=(1.3, 0.8, 1.1))
    _fit(axes["fit"], diagnosis)
    _residual(axes["residual"], diagnosis)
    _zoom(axes["zoom"], diagnosis)
    _spectrum(axes["spectrum"], diagnosis)
    above.align_ylabels([axes["fit"], axes["residual"], axes["zoom"]])
    _faults(below, diagnosis, truth)
    _title(figure, diagnosis.recording, diagnosis.actuator)
    return figure


def draw_fit(diagnosis: Diagnosis) -> "Figure":
    """Draw the recorded current against the model's, and enlarged where they differ most."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 4.4), layout="constrained")
    whole, zoom = figure.subplots(2, 1)
    _fit(whole, diagnosis)
    _zoom(zoom, diagnosis)
    figure.align_ylabels()
    return figure


def draw_residual(diagnosis: Diagnosis) -> "Figure":
    """Draw what the model leaves over: over time, and its spectrum below that of the current."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    residual, spectrum = figure.subplots(2, 1)
    _residual(residual, diagnosis)
    _spectrum(spectrum, diagnosis)
    figure.align_ylabels()
    return figure


def draw_faults(diagnosis: Diagnosis, truth: Faults | None = None) -> "Figure":
    """Draw the eight components with their 95 % intervals and healthy values, the truth as open markers."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    _faults(figure, diagnosis, truth)
    return figure


def draw_replay(
    recording: Recording,
    signals: Mapping[str, Array],
    actuator: Actuator,
    relative_error: Mapping[str, float],
) -> "Figure":
    """Draw measured against modelled for each channel of `relative_error`, the residual below each.

    Parameters
    ----------
    recording, signals
        What was measured, and the model's channels by the same names, each of shape (samples,).
    actuator
        Its coordinates give the units.
    relative_error
        rms(measured - model) / rms(measured) by channel, as a fraction.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 0.6 + 2.9 * len(relative_error)), layout="constrained")
    heights = (2.2, 1) * len(relative_error)
    axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    time = recording["time_s"]
    for (name, error), above, below in zip(relative_error.items(), axes[::2], axes[1::2], strict=True):
        unit = unit_for(SCHEMA[name].unit, actuator.coordinates)
        residual = recording[name] - signals[name]
        _pair(above, time, recording[name], signals[name], "measured")
        meaning = SCHEMA[name].meaning
        size = f"{100 * error:.3g} %" if np.isfinite(error) else "undefined, as 0 was measured"
        _style(above, f"{meaning.capitalize()}: relative error {size}", "", f"{meaning} [{unit}]")
        _legend(above)
        # The model's angle may run on where the sensor's starts again.
        _line(below, time, wrap(residual) if name == "angle_rad" else residual, RESIDUAL)
        _style(below, "", "time [s]", f"residual [{unit}]")
        below.tick_params(labelbottom=True)
    figure.align_ylabels(axes)
    _title(figure, recording.source, actuator)
    return figure


def _fit(axis: "Axes", diagnosis: Diagnosis) -> None:
    _pair(axis, diagnosis.time_s, diagnosis.recorded, diagnosis.modelled, "recorded")
    shown = diagnosis.time_s[_worst_rows(diagnosis)]
    axis.axvspan(shown[0], shown[-1], color=FAINT, alpha=0.25, linewidth=0)
    _style(axis, "Current", "time [s]", "equivalent current [A]")
    _legend(axis)


def _zoom(axis: "Axes", diagnosis: Diagnosis) -> None:
    rows = _worst_rows(diagnosis)
    _pair(axis, diagnosis.time_s[rows], diagnosis.recorded[rows], diagnosis.modelled[rows], "recorded")
    _style(axis, "Shaded part, where they differ most", "time [s]", "equivalent current [A]")


def _worst_rows(diagnosis: Diagnosis) -> slice:
    """Return the rows of the stretch in which the residual is largest."""
    squares = (diagnosis.recorded - diagnosis.modelled) ** 2
    length = max(round(ZOOM_SHARE * squares.size), 2)
    sums = np.concatenate([[0.0], np.cumsum(squares)])
    start = int(np.argmax(sums[length:] - sums[:-length]))
    return slice(start, start + length)


def _residual(axis: "Axes", diagnosis: Diagnosis) -> None:
    _line(axis, diagnosis.time_s, diagnosis.recorded - diagnosis.modelled, RESIDUAL)
    rms, share = f"{diagnosis.residual_rms_A:.3g} A rms", f"{100 * diagnosis.relative_residual:.1f} %"
    title = f"Residual, recorded less model: {rms}, {share} of the current"
    _style(axis, title, "time [s]", "residual [A]")


def _spectrum(axis: "Axes", diagnosis: Diagnosis) -> None:
    """Draw the amplitude density of current and residual, which tells at what pace the model errs."""
    from scipy.signal import welch

    time = diagnosis.time_s
    rate = (time.size - 1) / (time[-1] - time[0])
    residual = diagnosis.recorded - diagnosis.modelled
    for label, values, colour in (
        ("recorded", diagnosis.recorded, RECORDED),
        ("residual", residual, RESIDUAL),
    ):
        frequency, power = welch(values, rate, nperseg=min(time.size // 2, 4096))
        if np.any(power[1:] > 0):
            axis.loglog(frequency[1:], np.sqrt(power[1:]), color=colour, linewidth=1, label=label)
    _style(axis, "Spectrum", "frequency [Hz]", "density [A/√Hz]")
    _legend(axis)


def _faults(figure: "FigureBase", diagnosis: Diagnosis, truth: Faults | None) -> None:
    axis = figure.subplots()
    for row, (name, estimate) in enumerate(diagnosis.components.items()):
        _component(axis, row, estimate)
        is_phase = name == "eccentricity_phase"  # no direction is healthy, nor true without eccentricity
        if not is_phase:
            axis.plot(getattr(HEALTHY, name), row, "|", color="black", markersize=12)
        if truth and not (is_phase and truth.eccentricity == 0):
            axis.plot(getattr(truth, name), row, "D", color="black", markersize=8, fillstyle="none")
    axis.set_xlim(-0.03, 1.03)
    axis.set_ylim(len(NAMES) - 0.5, -0.5)
    axis.set_yticks(range(len(NAMES)), NAMES)
    _style(axis, "", "normalised value and 95 % interval", "")
    for tick, estimate in zip(axis.get_yticklabels(), diagnosis.components.values(), strict=True):
        tick.set_color("black" if estimate.identifiable else FAINT)
    _fault_legend(figure, axis, with_truth=truth is not None)


def _component(axis: "Axes", row: int, estimate: Estimate) -> None:
    """Draw one component's interval and value, and write them beside the axis."""
    colour, marker = VERDICTS[estimate.verdict]
    low, high = estimate.interval95
    # A direction's interval may run past 0 or 1, where the circle closes: it comes in at the other end.
    for turn in (-1, 0, 1):
        ends = np.clip([low + turn, high + turn], 0, 1)
        if ends[0] < ends[1]:
            axis.plot(ends, [row, row], color=colour, linewidth=3, alpha=0.5, solid_capstyle="butt")
    text = "not identifiable"
    if estimate.identifiable:
        text = f"{estimate.value:.3f}  ({low:.3f} to {high:.3f})"
        axis.plot(estimate.value, row, marker, color=colour, markersize=5)
    shade = "black" if estimate.identifiable else FAINT
    axis.text(1.02, row, text, transform=axis.get_yaxis_transform(), va="center", fontsize=8, color=shade)


def _fault_legend(figure: "FigureBase", axis: "Axes", *, with_truth: bool) -> None:
    for verdict in ("healthy", "degraded"):
        colour, marker = VERDICTS[verdict]
        axis.plot([], [], marker, color=colour, markersize=5, label=verdict)
    axis.plot([], [], color=FAINT, linewidth=3, alpha=0.5, label="not identifiable")
    axis.plot([], [], "|", color="black", markersize=12, label="healthy value")
    if with_truth:
        axis.plot([], [], "D", color="black", markersize=8, fillstyle="none", label="true value")
    figure.legend(loc="outside upper center", ncols=5, **LEGEND)


def _pair(axis: "Axes", time: Array, measured: Array, modelled: Array, label: str) -> None:
    # The measured line is the wider one: it shows on both sides of a model that is right.
    _line(axis, time, measured, RECORDED, label, width=2.5)
    _line(axis, time, modelled, MODELLED, "model")


def _line(axis: "Axes", time: Array, values: Array, colour: str, label: str = "", width: float = 1) -> None:
    rows = _extremes(values)
    axis.plot(time[rows], values[rows], color=colour, linewidth=width, label=label)
    axis.margins(x=0)


def _extremes(values: Array) -> NDArray[np.intp]:
    """Return the rows that a line must pass through to look like all of `values` (n,)."""
    if values.size <= 2 * MOST_BINS:
        return np.arange(values.size)
    bins = np.array_split(np.arange(values.size), MOST_BINS)
    least = [rows[np.argmin(values[rows])] for rows in bins]
    most = [rows[np.argmax(values[rows])] for rows in bins]
    return np.unique([0, *least, *most, values.size - 1])


def _style(axis: "Axes", title: str, xlabel: str, ylabel: str) -> None:
    axis.set_title(title, loc="left", fontsize=9)
    axis.set_xlabel(xlabel, fontsize=8)
    axis.set_ylabel(ylabel, fontsize=8)
    axis.tick_params(which="both", labelsize=8)
    axis.yaxis.get_offset_text().set_fontsize(8)
    axis.grid(alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def _legend(axis: "Axes") -> None:
    """Put the legend at the right of the title, where it hides nothing."""
    handles, _ = axis.get_legend_handles_labels()
    axis.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1, 1), ncols=2, borderaxespad=0.2, **LEGEND
    )


def _title(figure: "Figure", source: str, actuator: Actuator) -> None:
    """Write what was recorded on what above the figure; a file's name is no formula, and may be long."""
    name = PurePath(source).name
    short = name if len(name) <= 60 else f"…{name[-59:]}"
    figure.suptitle(f"{short}, actuator {actuator.name}", fontsize=10, parse_math=False)
