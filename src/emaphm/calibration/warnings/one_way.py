"""What recordings that never reverse leave open: parameters that act alike in them.

Moving one way, dry friction acts as a constant load does, and unequal viscous friction as equal one. Only
the breakaway at standstill then separates them, by the friction that the model has there. On one stroke of
EMPS that led to 8.5 N ± 0.9 N of Coulomb friction and a load of 13 N; all strokes have 20.3 N, and no load.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.calibration.separation import CollinearParameters
from emaphm.calibration.unit_fit import UnitFit
from emaphm.diagnosis.explanation.one_way import moves_one_way
from emaphm.estimation.uncertainty.collinearity import listed


def open_members(fit: UnitFit, sets: Sequence[CollinearParameters]) -> tuple[str, ...]:
    """Return the parameters of collinear `sets`, if the model that was fitted reverses in no recording."""
    names = tuple(name for name in fit.free if any(name in one.members for one in sets))
    joint = fit.joint
    one_way = all(
        moves_one_way(term.objective, joint.local(r, fit.point)) for r, term in enumerate(joint.terms)
    )
    return names if names and one_way else ()


def with_open(fit: UnitFit, names: Sequence[str]) -> UnitFit:
    """Return the `fit` with the parameters `names` known no better than before the recordings.

    The variance of each gains that of its prior: their combined effect is taken as open too, as it is known
    of one direction only.
    """
    unit = fit.joint.unit
    priors = dict(zip(unit.parameters, unit.priors.tolist(), strict=True))
    added = [priors.get(name, 0.0) if name in names else 0.0 for name in fit.free]
    return replace(fit, covariance=fit.covariance + np.diag(np.square(added)))


def one_way_warnings(names: Sequence[str]) -> tuple[str, ...]:
    """Return a sentence on the parameters `names` that motion one way leaves open."""
    if not names:
        return ()
    known = f"{listed(names, 'and')} {'is' if len(names) == 1 else 'are'} known no better than before it"
    cause = "each recording moves one way only, where friction acts as a load does"
    return (f"{cause}: {known}; calibrate on a manoeuvre that reverses",)
