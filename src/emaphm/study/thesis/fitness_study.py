"""The thesis's fitness study (6.2), extended by the position of the minimum of the fitness.

A state of the actuator is recorded from the reference model. The thesis states the fitness of its monitor
model at the true faults. Here, the component of the state is also scanned from 0 to 1, with all other
components at their true values, to find the minimum of the fitness. Its distance from the truth is a bias
that no optimiser can remove, because it is a property of the objective.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import polars as pl

from emaphm.actuator import NAMES, Actuator, Chirp
from emaphm.errors import MethodError, nearest
from emaphm.estimation.cost_functions import COST_FUNCTIONS
from emaphm.estimation.posing import problem_of
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED, monitor
from emaphm.study.task import CURRENTS
from emaphm.study.thesis import published
from emaphm.text_table import markdown_table

MODELS = {
    "averaged": AVERAGED,
    "monitor": monitor(),
    "monitor, modulated": monitor("modulated"),
}
"""The models whose current is compared with the recorded current."""

POINTS = 100

GRID = np.arange(POINTS + 1) / POINTS
"""Values of a component in its scan, a percentage point apart; they include the true values of thesis 6.2."""


def fitness_study(actuator: Actuator) -> pl.DataFrame:
    """Return the fitness at the truth and in a scan through it, for each state of `published.FITNESS`.

    One row for each state, model, form of equivalent current and form of fitness:

    - fault, level: the state, e.g. "friction", "low"
    - model, equivalent, fitness: the forms
    - truth: true value of the fault's component
    - value: fitness at the truth (units: `emaphm.estimation.cost_functions`)
    - ratio: `value` to that of the fault's nominal state
    - printed, printed_ratio: the same in the thesis, whose units are unknown; compare the ratios
    - argmin: value on `GRID` with the least fitness, with all other components at their true values
    - bias_points: 100 (argmin - truth) [percentage points], on the circle for a phase
    - least: fitness at argmin
    - scan: fitness on `GRID`, 101 values

    Raises
    ------
    MethodError
        The actuator's windings are not described.
    """
    table = pl.DataFrame(list(_rows(actuator)))
    nominal = pl.col("level") == "nominal"
    forms = ("fault", "model", "equivalent", "fitness")
    return table.with_columns(
        (pl.col(value) / pl.col(value).filter(nominal).first().over(forms)).alias(ratio)
        for value, ratio in (("value", "ratio"), ("printed", "printed_ratio"))
    )


def _rows(actuator: Actuator) -> Iterator[dict[str, Any]]:
    command = Chirp()
    for state in published.FITNESS:
        recording = simulate(actuator, command, faults=state.faults, duration=command.duration)
        component = NAMES.index(state.fault)
        truth = float(state.faults.vector[component])
        scanned = np.tile(state.faults.vector, (GRID.size, 1))
        scanned[:, component] = GRID
        for model_name, model in MODELS.items():
            modelled = problem_of(recording, actuator, model).predict_primary(scanned)
            for (form, channel), (fitness_name, fitness) in product(CURRENTS.items(), COST_FUNCTIONS.items()):
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
                    "bias_points": grid_distance(state.fault, least - true),
                    "least": float(scan[least]),
                    "scan": scan.tolist(),
                }


def grid_distance(fault: str, distance: int) -> int:
    """Return a distance on `GRID`; for a phase, whose 0 and 1 are equal, the shortest on the circle."""
    if fault != "eccentricity_phase":
        return distance
    return (distance + POINTS // 2) % POINTS - POINTS // 2


SET_UPS = (("monitor", "magnitude"), ("averaged", "magnitude"), ("averaged", "torque"))
"""Model and current of the table's columns: those of the thesis, model corrected, and both corrected."""


def fitness_table(study: pl.DataFrame, fitness: str = "thesis") -> str:
    """Return a summary of a `fitness_study` as a Markdown table, with the printed values of the thesis.

    The thesis does not state its unit; its values can be compared only by their ratios to the nominal state
    of the fault. For each of `SET_UPS`: this ratio, and the bias of the minimum.

    Raises
    ------
    MethodError
        The form of fitness is unknown.
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
    lines = []
    if fitness not in COST_FUNCTIONS:
        raise MethodError(f"unknown fitness '{fitness}'{nearest(fitness, COST_FUNCTIONS)}")
    states = study.filter(pl.col("fitness") == fitness).group_by("fault", "level", maintain_order=True)
    for (fault, level), rows in states:
        by_set_up = {(row["model"], row["equivalent"]): row for row in rows.iter_rows(named=True)}
        of_thesis = by_set_up[SET_UPS[0]]
        lines.append(
            (
                str(fault),
                str(level),
                f"{of_thesis['printed']:.1e}",
                f"{of_thesis['printed_ratio']:.3g}",
                *(f"{by_set_up[set_up]['ratio']:.3g}" for set_up in SET_UPS),
                *(f"{by_set_up[set_up]['bias_points']:+d}" for set_up in SET_UPS),
            )
        )
    return markdown_table(header, lines, words=2) + "\n"
