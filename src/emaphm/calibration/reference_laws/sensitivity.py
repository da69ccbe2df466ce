"""How much of a parameter's effect in the averaged model the reference model has too.

The ripple of a switched current breaks a resting shaft away before its mean does. The averaged model has no
ripple, so that static friction acts on it more than on a machine: its minimum is sharp, and the estimate by
the corrected model is known far less well than the sensitivities of the averaged model say.

An estimate θ solves Jᵀ(y - y_ref(θ)) = 0, with J the sensitivities of the averaged model and y_ref the reference
model, as the correction has it. Its error is therefore (Jᵀ J_ref)⁻¹ Jᵀ ε: larger than (Jᵀ J)⁻¹ Jᵀ ε by the
inverse of the share b = Jᵀ J_ref / Jᵀ J, as of an instrumental variable (Davidson and MacKinnon 2004, ch. 8).
"""

from dataclasses import replace

import numpy as np

from emaphm.arrays import Array
from emaphm.calibration.findings import LARGEST_ERROR
from emaphm.calibration.unit_fit import UnitFit
from emaphm.estimation.discrepancy import resolves_switching
from emaphm.estimation.joint.correction import compared

AT_REST = ("static", "stribeck_speed", "transition_speed", "presliding_stiffness", "presliding_damping")
"""Parameters that act where a shaft breaks away. All others have shares of 0.95 to 1.0 on the thesis's actuator."""

STEP = 0.1
"""By how much a parameter is changed, by the logarithm: about the error that is left of static friction."""

LEAST = 0.8
"""Share from which the averaged model's sensitivity is taken for right."""

Z = 2.0
"""Standard errors that a share is less by, for the switching of the runs that it is computed from."""


def with_reference_sensitivity(fit: UnitFit, seed: int) -> tuple[UnitFit, tuple[str, ...]]:
    """Return the fit with the covariance of what acts at rest widened, and a warning on each such parameter."""
    problems = [term.objective.problem for term in fit.joint.terms]
    if not fit.estimate.corrected or not all(map(resolves_switching, problems)):
        return fit, ()
    factors, warnings = np.ones(len(fit.free)), []
    for name in AT_REST:
        if name not in fit.fitted:
            continue
        share = reference_share(fit, fit.fitted.index(name), seed)
        if share >= LEAST:
            continue
        i = fit.free.index(name)
        error = float(fit.standard_errors[i])
        factors[i] = max(min(1 / share, LARGEST_ERROR / error) if share > 0 else LARGEST_ERROR / error, 1.0)
        warnings.append(
            f"{name} acts less by the reference model, in which the ripple of the current breaks a resting shaft "
            f"away, than by the averaged one: its standard error is {factors[i]:.2g} times as large as that one's"
        )
    widened = replace(fit, covariance=fit.covariance * np.outer(factors, factors))
    return widened, tuple(warnings)


def reference_share(fit: UnitFit, column: int, seed: int) -> float:
    """Return the least share of the effect of a fitted parameter that the reference model has."""
    points = np.stack([fit.point, fit.point])
    points[:, column] += -STEP, STEP
    low, high = compared(fit.joint, points, seed, "sensitivity", column)
    both = squares = variance = 0.0
    for r, term in enumerate(fit.joint.terms):
        weight = 1 / term.residual_rms**2
        effect: Array = low.residuals[r] - high.residuals[r]
        both += weight * float(effect @ (low.corrected_residuals[r] - high.corrected_residuals[r]))
        squares += weight * float(effect @ effect)
        errors = low.discrepancies[r].standard_error ** 2 + high.discrepancies[r].standard_error ** 2
        variance += weight**2 * float(effect**2 @ errors)
    return both / squares - Z * variance**0.5 / squares if squares else 1.0
