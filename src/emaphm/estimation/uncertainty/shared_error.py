"""Error that all recordings of a unit share, because they have the same deviations of the unit's parameters.

Faults f are estimated with the unit's deviations u, whose prior is normal with the covariance P
(`ParameterVariation`). With the covariance C of the estimate, a linear model has the error -C_fu P⁻¹ u in f,
plus the effect of noise: where a recording does not identify u, the prior's mean replaces it. The noise
differs between recordings; u does not.
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

    Its rows are the faults among the `coordinates` (d,), in their order. None if no parameter of the unit is
    estimated. `suspected` are the prior standard deviations, by coordinate, of parameters that are estimated
    because a recording indicated that they deviate.
    """
    unit = ParameterVariation.of_unit(actuator)
    of_unit = zip((BASELINE + name for name in unit.coordinates), unit.priors, strict=True)
    priors = {**dict(of_unit), **suspected}
    deviations = [i for i, name in enumerate(coordinates) if name in priors]
    if not deviations:
        return None
    faults = [i for i, name in enumerate(coordinates) if name in CARTESIAN_NAMES]
    cross = covariance[np.ix_(faults, deviations)] / [priors[coordinates[i]] for i in deviations]
    # Errors of the derivatives could make the shared part larger than the covariance: limit it.
    variances, axes = np.linalg.eigh(covariance[np.ix_(faults, faults)])
    root = axes * np.sqrt(np.maximum(variances, 0.0))
    directions, shares, _ = np.linalg.svd(np.linalg.pinv(root) @ cross, full_matrices=False)
    bounded = root @ directions * np.minimum(shares, 1.0)
    return np.asarray(bounded @ bounded.T)
