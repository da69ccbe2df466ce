"""The thesis's fitness study (6.2), and whether the fitness is least at the truth, which it does not ask.

A state of the actuator is recorded from the reference model. The thesis gives the fitness of its monitor
model there at the true faults. Here it is also computed where the fitness is least when the state's own
component varies from 0 to 1 and all others are true. How far that is from the truth is a bias that no
optimiser can remove: it lies in what the optimiser is given to minimise.
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
"""The models whose current is compared with the recorded one."""

POINTS = 100

GRID = np.arange(POINTS + 1) / POINTS
"""Values of a component along its scan, a percentage point apart; the truths of thesis 6.2 are among them."""


def fitness_study(actuator: Actuator) -> pl.DataFrame:
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
    lines = []
    if fitness not in COST_FUNCTIONS:
        raise MethodError(f"unknown fitness '{fitness}'{nearest(fitness, COST_FUNCTIONS)}")
    states = study.filter(pl.col("fitness") == fitness).group_by("fault", "level", maintain_order=True)
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
    return markdown_table(header, lines, words=2) + "\n"
