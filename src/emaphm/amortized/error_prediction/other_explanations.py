"""Whether faults that an answer alone names may be something else: a delay, or what is not as described.

Asked where no search follows, and where a component is called degraded: a search asks for both itself.
"""

from dataclasses import replace

from emaphm.amortized.error_prediction.corrected_step import CorrectedStep
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.alternatives import beyond_a_delay
from emaphm.diagnosis.selection.control_errors import contradicted_control
from emaphm.diagnosis.selection.description_errors import possible_errors
from emaphm.diagnosis.selection.laws.hidden_laws import suspected_laws
from emaphm.diagnosis.verdict import Estimate, estimates
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.random_streams import stream


def other_explanations(result: SearchResult, covariance: Array, seed: int) -> tuple[str, ...]:
    """Return what else may be the faults of an answer, a clause each; nothing where it calls none degraded.

    `result` is the averaged model at the answer's mean, whose `covariance` is (d, d).
    """
    components = estimates(result.objective.space, result.point, covariance)
    if all(one.verdict != "degraded" for one in components.values()):
        return ()
    weighted = result.reweighted()
    jacobians = jacobians_at(weighted.objective, result.point, stream(seed, "Jacobians at the answer"))
    delay = _delay(components["gain"], weighted, jacobians)
    return delay or _undescribed(replace(weighted, jacobians=jacobians), covariance, seed)


def _delay(gain: Estimate, result: SearchResult, jacobians: Array) -> tuple[str, ...]:
    """Return why the gain may be a delay; nothing where it is none.

    The residual at the answer shows no delay of a row where the actuator is nearly healthy. The search, which
    has the reference model, knows the gain better, and says what it cannot exclude.
    """
    if gain.verdict != "degraded":
        return ()
    checked = beyond_a_delay(gain, result, jacobians)
    return () if checked.verdict == "degraded" else (f"its gain may be a delay: {checked.reason}",)


def _undescribed(result: SearchResult, covariance: Array, seed: int) -> tuple[str, ...]:
    """Return what the residual shows that is not described, once the reference model has corrected it."""
    corrected = with_discrepancy(result, seed)
    if names := suspected_laws(corrected, seed):
        laws = " or ".join(f"'{name}'" for name in names)
        return (f"its faults may be a law that the actuator's description lacks: {laws}",)
    parameters = [name for one in possible_errors(corrected, (), seed) for name in one.parameters]
    parameters += contradicted_control(corrected, seed)
    if parameters:
        return (f"its faults may be parameters that are not as described: {', '.join(parameters)}",)
    return CorrectedStep.of(corrected, covariance).reasons
