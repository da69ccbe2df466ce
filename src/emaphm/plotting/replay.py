"""Figure of a replay: each recorded and modelled channel, with the residual below."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.plotting.style import PAGE_WIDTH, RESIDUAL, legend_beside_title, new_figure, style_axis
from emaphm.plotting.time_series import draw_line, draw_recorded_and_model, title_with_recording
from emaphm.recording import Recording
from emaphm.recording.schema import SCHEMA
from emaphm.simulation.laws.angles import wrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_replay(
    recording: Recording,
    signals: Mapping[str, Array],
    actuator: Actuator,
    relative_error: Mapping[str, float],
) -> "Figure":
    """Return the figure of recorded and modelled signals by channel of `relative_error`, with residuals.

    Parameters
    ----------
    recording, signals
        The recording, and the model's channels with the same names, each of shape (samples,).
    actuator
        Actuator whose coordinates give the units.
    relative_error
        rms(recorded - model) / rms(recorded) by channel, as a fraction.
    """
    figure = new_figure(PAGE_WIDTH, 0.6 + 3.1 * len(relative_error))
    heights = (2, 1.2) * len(relative_error)
    axes = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    time = recording["time_s"]
    for (name, error), above, below in zip(relative_error.items(), axes[::2], axes[1::2], strict=True):
        unit = unit_for(SCHEMA[name].unit, actuator.coordinates)
        meaning = SCHEMA[name].meaning
        draw_recorded_and_model(above, time, recording[name], signals[name])
        size = f"{100 * error:.3g} %" if np.isfinite(error) else "undefined, the recorded signal is 0"
        style_axis(above, f"{meaning.capitalize()}: relative error {size}", "", f"{meaning} [{unit}]")
        legend_beside_title(above)
        residual = recording[name] - signals[name]
        # The model's angle may continue where the sensor's angle wraps around.
        draw_line(below, time, wrap(residual) if name == "angle_rad" else residual, RESIDUAL)
        style_axis(below, "", "time [s]", f"residual [{unit}]")
        below.tick_params(labelbottom=True)
    figure.align_ylabels(axes)
    title_with_recording(figure, recording.source, actuator)
    return figure
