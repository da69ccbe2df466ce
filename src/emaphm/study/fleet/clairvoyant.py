"""Clairvoyant prediction of the remaining useful life: an upper bound for the quality of any prediction."""

import numpy as np

from emaphm.actuator.faults import NAMES
from emaphm.arrays import Array
from emaphm.fleet.synthetic import FleetPlan, SyntheticUnit
from emaphm.fleet.synthetic.growth import LAWS
from emaphm.fleet.synthetic.unit import STEPS, aged
from emaphm.random_streams import stream

PATHS = 200
"""Number of future paths: the standard error of a share of one half is then 3.5 %."""

LONGEST_LIFE = 10_000.0
"""Longest simulated life [h]; no unit of the study lives longer."""


def clairvoyant(unit: SyntheticUnit, hours: float, plan: FleetPlan) -> Array:
    """Return a sample of the RUL at flight `hours` [h], (`PATHS`,), `inf` without a failure.

    The prediction uses the law of each component with its parameters, its true level, and the mission of the
    unit. It does not use future random events: the stress of future flights, jumps, drift, and the times of
    future onsets or changes of rate.
    """
    population, row = plan.drawn_from, unit.row(hours)
    random = stream(plan.seed, "clairvoyant", unit.serial_number, row)
    ahead = np.arange(0.0, LONGEST_LIFE - hours, plan.interval / STEPS)
    intervals = int(np.ceil(ahead[-1] / plan.interval)) + 1
    life = np.full(PATHS, np.inf)
    for path in range(PATHS):
        future = population.stress.drawn(unit.mission, intervals, random)
        ageing = unit.ageing[row] + aged(ahead, future, population.stress, plan.interval)
        for component in unit.components:
            u = ageing / component.life
            law, column = LAWS[component.law], NAMES.index(component.name)
            p = law.progress(u, law.still_open(component.parameters, float(u[0]), random), random)
            drift = population.drift / component.limit * np.sqrt(np.diff(u, prepend=u[0]))
            p = p - p[0] + np.cumsum(drift * random.standard_normal(u.size))
            failed = component.failed(component.level(unit.vectors[row, column], p))
            if failed.any():
                life[path] = min(life[path], ahead[int(failed.argmax())])
    return life
