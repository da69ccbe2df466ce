"""The error that all recordings of a unit share: how its parameters deviate is the same in each of them.

Faults f are estimated with the unit's deviations u, whose prior is normal with the covariance P
(`ParameterVariation`). With the covariance C of the estimate, a linear model errs in f by -C_fu P⁻¹ u, and by
what noise makes of it: as far as a recording does not show u, the prior's mean stands in for it. The noise is
another in each recording, u is not.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.faults import CARTESIAN_NAMES
from emaphm.arrays import Array
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_variation import ParameterVariation


def shared_covariance(
    actuator: Actuator, coordinates: Sequence[str], covariance: Array, suspected: Mapping[str, float]
) -> Array | None:
    """Return the part of a `covariance` (d, d) that all recordings of a unit share, C_fu P⁻¹ C_uf, (f, f).

    Of the faults among the `coordinates` (d,), in their order. None where nothing of the unit is open.
    `suspected` are the standard deviations of priors of what was opened because a recording asked for it.
    """
    unit = ParameterVariation.of_unit(actuator)
    open_ones = zip((BASELINE + name for name in unit.coordinates), unit.priors, strict=True)
    priors = {**dict(open_ones), **suspected}
    own = [i for i, name in enumerate(coordinates) if name in priors]
    if not own:
        return None
    faults = [i for i, name in enumerate(coordinates) if name in CARTESIAN_NAMES]
    across = covariance[np.ix_(faults, own)] / [priors[coordinates[i]] for i in own]
    # Derivatives have errors of their own, and may claim a larger part than the whole.
    variances, axes = np.linalg.eigh(covariance[np.ix_(faults, faults)])
    root = axes * np.sqrt(np.maximum(variances, 0.0))
    directions, shares, _ = np.linalg.svd(np.linalg.pinv(root) @ across, full_matrices=False)
    bounded = root @ directions * np.minimum(shares, 1.0)
    return np.asarray(bounded @ bounded.T)
