"""The thesis's fitness study (6.2), and whether the fitness is least at the truth, which it does not ask.

A state of the actuator is recorded from the reference model. The thesis gives the fitness of its monitor
model there at the true faults. Here it is also computed where the fitness is least when the state's own
component varies from 0 to 1 and all others are true. How far that is from the truth is a bias that no
optimiser can remove: it lies in what the optimiser is given to minimise.
"""

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import polars as pl

from emaphm.actuator import NAMES, Actuator, Chirp
from emaphm.errors import MethodError, nearest
from emaphm.estimation.cost_functions import FITNESSES
from emaphm.estimation.problem import Problem
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED, monitor
from emaphm.study.task import CURRENTS
from emaphm.study.thesis import published

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = {
    "averaged": AVERAGED,
    "monitor": monitor(),
    "monitor, modulated": monitor("modulated"),
}
"""The models whose current is compared with the recorded one."""

POINTS = 100

GRID = np.arange(POINTS + 1) / POINTS
"""Values of a component along its scan, a percentage point apart; the truths of thesis 6.2 are among them."""


def fitness_study(actuator: Actuator, command: Chirp = Chirp()) -> pl.DataFrame:  # noqa: B008 - frozen
    """Return the fitness at the truth and along a scan through it, for each state of `published.FITNESS`.

    One row for each state, model, form of equivalent current and form of fitness:

    - fault, level: the state, e.g. "friction", "low"
    - model, equivalent, fitness: the forms
    - truth: of the fault's component
    - value: fitness at the truth (units: `emaphm.estimation.cost_functions`)
    - ratio: `value` to that of the fault's nominal state
    - printed, printed_ratio: the same in the thesis, whose units are unknown; compare the ratios
    - argmin: where on `GRID` the fitness is least, all other components true
    - bias_points: 100 (argmin - truth) [percentage points], on the circle for a phase
    - least: fitness there
    - scan: fitness on `GRID`, 101 values

    Raises
    ------
    MethodError
        The actuator's windings are not described.
    """
    table = pl.DataFrame(list(_rows(actuator, command)))
    nominal = pl.col("level") == "nominal"
    forms = ("fault", "model", "equivalent", "fitness")
    return table.with_columns(
        (pl.col(value) / pl.col(value).filter(nominal).first().over(forms)).alias(ratio)
        for value, ratio in (("value", "ratio"), ("printed", "printed_ratio"))
    )


def _rows(actuator: Actuator, command: Chirp) -> Iterator[dict[str, Any]]:
    for state in published.FITNESS:
        recording = simulate(actuator, command, faults=state.faults, duration=command.duration)
        component = NAMES.index(state.fault)
        truth = float(state.faults.vector[component])
        scanned = np.tile(state.faults.vector, (GRID.size, 1))
        scanned[:, component] = GRID
        for model_name, model in MODELS.items():
            modelled = Problem.of(recording, actuator, model).currents(scanned)
            for (form, channel), (fitness_name, fitness) in product(CURRENTS.items(), FITNESSES.items()):
                scan = fitness(recording[channel], modelled, recording.interval_s)
                least, true = int(np.argmin(scan)), int(GRID.searchsorted(truth))
                yield {
                    "fault": state.fault,
                    "level": state.level,
                    "model": model_name,
                    "equivalent": form,
                    "fitness": fitness_name,
                    "truth": truth,
                    "value": float(scan[true]),
                    "printed": state.value,
                    "argmin": float(GRID[least]),
                    "bias_points": _points(state.fault, least - true),
                    "least": float(scan[least]),
                    "scan": scan.tolist(),
                }


def _points(fault: str, distance: int) -> int:
    """Return a distance on `GRID`; for a phase, whose 0 and 1 are the same, the shorter way round."""
    if fault != "eccentricity_phase":
        return distance
    return (distance + POINTS // 2) % POINTS - POINTS // 2


SET_UPS = (("monitor", "magnitude"), ("averaged", "magnitude"), ("averaged", "torque"))
"""Model and current of the table's columns: the thesis's, one of the two corrected, both corrected."""


def fitness_table(study: pl.DataFrame, fitness: str = "thesis") -> str:
    """Return the essence of a `fitness_study` as a Markdown table, with the thesis's printed values.

    The thesis does not state its unit, so that its values are not to be compared with others but by their
    ratios to the fault's nominal state. For each of `SET_UPS`: that ratio, and the bias of the least value.

    Raises
    ------
    MethodError
        There is no such form of fitness.
    """
    names = [f"{model} model, {equivalent}" for model, equivalent in SET_UPS]
    header = (
        "fault",
        "level",
        "thesis: fitness",
        "thesis: × nominal",
        *(f"{name}: × nominal" for name in names),
        *(f"{name}: bias, points" for name in names),
    )
    lines = [header, ("---", "---", *["---:"] * (len(header) - 2))]
    states = _of(study, fitness).group_by("fault", "level", maintain_order=True)
    for (fault, level), rows in states:
        found = {(row["model"], row["equivalent"]): row for row in rows.iter_rows(named=True)}
        one = found[SET_UPS[0]]
        lines.append(
            (
                str(fault),
                str(level),
                f"{one['printed']:.1e}",
                f"{one['printed_ratio']:.3g}",
                *(f"{found[set_up]['ratio']:.3g}" for set_up in SET_UPS),
                *(f"{found[set_up]['bias_points']:+d}" for set_up in SET_UPS),
            )
        )
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def _of(study: pl.DataFrame, fitness: str) -> pl.DataFrame:
    if fitness not in FITNESSES:
        raise MethodError(f"unknown fitness '{fitness}'{nearest(fitness, FITNESSES)}")
    return study.filter(pl.col("fitness") == fitness)


COLOURS = {"torque": "#0072b2", "magnitude": "#d55e00"}
"""Told apart by the colour-blind (Okabe and Ito 2008), and in grey print by their lightness."""

DASHES: dict[str, Literal["-", "--"]] = {"low": "-", "high": "--"}


def draw_scans(study: pl.DataFrame, model: str = "averaged") -> "Figure":
    """Draw the mean squared difference along the scans of a `fitness_study`: a panel for each fault.

    For the low and the high state, and the torque and the magnitude current; a dot where it is least, a
    vertical line at the truth.

    Raises
    ------
    MethodError
        There is no such model in the study.
    """
    from matplotlib.figure import Figure

    if model not in MODELS:
        raise MethodError(f"unknown model '{model}'{nearest(model, MODELS)}")
    shown = _of(study, "least_squares").filter(
        pl.col("model") == model,
        pl.col("equivalent").is_in(list(COLOURS)),
        pl.col("level").is_in(list(DASHES)),
    )
    figure = Figure(figsize=(8, 7.5), layout="constrained")
    axes = figure.subplots(3, 2, sharey=True)
    for axis, ((fault,), rows) in zip(axes.flat, shown.group_by("fault", maintain_order=True), strict=True):
        _scans(axis, rows)
        axis.set_title(str(fault), loc="left", fontsize=9)
    for axis in axes[-1]:
        axis.set_xlabel("normalised component, all others true", fontsize=8)
    for axis in axes[:, 0]:
        axis.set_ylabel("mean squared difference [A²]", fontsize=8)
    _legend(figure)
    return figure


def _scans(axis: "Axes", rows: pl.DataFrame) -> None:
    for row in rows.iter_rows(named=True):
        colour, dashes = COLOURS[row["equivalent"]], DASHES[row["level"]]
        axis.axvline(row["truth"], color="0.6", linestyle=dashes, linewidth=1)
        axis.semilogy(GRID, row["scan"], color=colour, linestyle=dashes, linewidth=1.3)
        axis.plot(row["argmin"], row["least"], "o", color=colour, markersize=5)
    axis.margins(x=0)
    axis.set_xlim(-0.02, 1.02)
    axis.tick_params(which="both", labelsize=8)
    axis.grid(alpha=0.3)
    axis.spines[["top", "right"]].set_visible(False)


def _legend(figure: "Figure") -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=colour, linestyle=dashes, label=f"{form} current, {level}")
        for form, colour in COLOURS.items()
        for level, dashes in DASHES.items()
    ]
    handles.append(Line2D([], [], color="0.3", marker="o", linestyle="", markersize=5, label="least"))
    handles.append(Line2D([], [], color="0.6", linewidth=1, label="truth"))
    figure.legend(handles=handles, loc="outside upper center", ncols=3, frameon=False, fontsize=8)
