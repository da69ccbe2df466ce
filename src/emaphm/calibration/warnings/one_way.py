"""Warnings on recordings without a reversal of motion, in which some parameters have the same effect.

In motion in one direction, dry friction has the effect of a constant load, and asymmetric viscous friction
that of symmetric viscous friction. Only the breakaway at standstill separates them, and depends on the model
of friction at standstill. One stroke of EMPS gave 8.5 N ± 0.9 N of Coulomb friction and a load of 13 N; all
strokes together give 20.3 N and no load.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from emaphm.calibration.separation import CollinearParameters
from emaphm.calibration.unit_fit import UnitFit
from emaphm.diagnosis.explanation.one_way import moves_one_way
from emaphm.estimation.uncertainty.collinearity import listed


def open_members(fit: UnitFit, sets: Sequence[CollinearParameters]) -> tuple[str, ...]:
    """Return the parameters of collinear `sets` if the fitted model reverses in no recording."""
    names = tuple(name for name in fit.free if any(name in collinear.members for collinear in sets))
    joint = fit.joint
    one_way = all(
        moves_one_way(term.objective, joint.local(r, fit.point)) for r, term in enumerate(joint.terms)
    )
    return names if names and one_way else ()


def with_open(fit: UnitFit, names: Sequence[str]) -> UnitFit:
    """Return the `fit` with the variances of the priors added for the parameters `names`.

    These parameters are then known no better than before the recordings; neither is their combined effect,
    which was observed in one direction only.
    """
    unit = fit.joint.unit
    priors = dict(zip(unit.parameters, unit.priors.tolist(), strict=True))
    added = [priors.get(name, 0.0) if name in names else 0.0 for name in fit.free]
    return replace(fit, covariance=fit.covariance + np.diag(np.square(added)))


def one_way_warnings(names: Sequence[str]) -> tuple[str, ...]:
    """Return a sentence on the parameters `names` that motion in one direction leaves open."""
    if not names:
        return ()
    known = f"{listed(names, 'and')} {'is' if len(names) == 1 else 'are'} known no better than before it"
    cause = "each recording moves one way only, where friction acts like a load"
    return (f"{cause}: {known}; calibrate on a manoeuvre that reverses",)
