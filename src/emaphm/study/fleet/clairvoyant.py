"""The remaining useful life that a clairvoyant predicts: the best that any prediction can be."""

import numpy as np

from emaphm.actuator.faults import NAMES
from emaphm.arrays import Array
from emaphm.fleet.synthetic import FleetPlan, SyntheticUnit
from emaphm.fleet.synthetic.growth import LAWS
from emaphm.fleet.synthetic.unit import STEPS, aged
from emaphm.random_streams import stream

PATHS = 200
"""Of the unit's future: a share of a half is then right to 3.5 %."""

LONGEST_LIFE = 10_000.0
"""How far is looked [h]; no unit of the study lives as long."""


def clairvoyant(unit: SyntheticUnit, hours: float, plan: FleetPlan) -> Array:
    """Return a sample of the RUL at flight `hours` [h], (`PATHS`,), `inf` for none in sight.

    The clairvoyant knows each component's law with its parameters, its true level, and the unit's mission. It
    does not know what chance has not decided yet: the stress of flights to come, jumps, drift, and the moment
    of an onset or change that is still to come.
    """
    population, row = plan.drawn_from, unit.row(hours)
    random = stream(plan.seed, "clairvoyant", unit.serial_number, row)
    ahead = np.arange(0.0, LONGEST_LIFE - hours, plan.interval / STEPS)
    life = np.full(PATHS, np.inf)
    for path in range(PATHS):
        ageing = unit.ageing[row] + aged(ahead, unit.mission, population.stress, plan.interval, random)
        for one in unit.components:
            u = ageing / one.life
            law, column = LAWS[one.law], NAMES.index(one.name)
            p = law.progress(u, law.still_open(one.parameters, float(u[0]), random), random)
            drift = population.drift / one.limit * np.sqrt(np.diff(u, prepend=u[0]))
            p = p - p[0] + np.cumsum(drift * random.standard_normal(u.size))
            beyond = one.failed(one.level(unit.vectors[row, column], p))
            if beyond.any():
                life[path] = min(life[path], ahead[int(beyond.argmax())])
    return life
