"""Other explanations of an answer's faults: a delay, or deviations from the description.

They are tested if no search follows and the answer calls a component degraded. A search tests both itself.
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
    """Return other possible explanations of an answer's faults, a clause each; none if none is degraded.

    `result` is the averaged model at the answer's mean; `covariance` (d, d) is the answer's.
    """
    components = estimates(result.objective.space, result.point, covariance)
    if all(component.verdict != "degraded" for component in components.values()):
        return ()
    weighted = result.reweighted()
    jacobians = jacobians_at(weighted.objective, result.point, stream(seed, "Jacobians at the answer"))
    delay = _delay_instead_of_gain(components["gain"], weighted, jacobians)
    return delay or _deviations_from_description(replace(weighted, jacobians=jacobians), covariance, seed)


def _delay_instead_of_gain(gain: Estimate, result: SearchResult, jacobians: Array) -> tuple[str, ...]:
    """Return the clause that the gain may be a delay; none if it cannot be one.

    If the actuator is nearly healthy, a delay of a row does not change the residual at the answer. A search
    has the reference model, estimates the gain more precisely, and states what it cannot exclude.
    """
    if gain.verdict != "degraded":
        return ()
    checked = beyond_a_delay(gain, result, jacobians)
    return () if checked.verdict == "degraded" else (f"its gain may be a delay: {checked.reason}",)


def _deviations_from_description(result: SearchResult, covariance: Array, seed: int) -> tuple[str, ...]:
    """Return the laws or parameters that the residual after the reference model's correction indicates.

    If it indicates none, the clauses of `CorrectedStep`.
    """
    corrected = with_discrepancy(result, seed)
    if names := suspected_laws(corrected, seed):
        laws = " or ".join(f"'{name}'" for name in names)
        return (f"its faults may be a law that the actuator's description lacks: {laws}",)
    parameters = [name for error in possible_errors(corrected, (), seed) for name in error.parameters]
    parameters += contradicted_control(corrected, seed)
    if parameters:
        return (f"its faults may be parameters that deviate from the description: {', '.join(parameters)}",)
    return CorrectedStep.of(corrected, covariance).reasons
