"""When an estimate explains a recording, and if not, why: in every channel, and with plausible nuisances."""

from collections.abc import Iterator, Mapping

from emaphm.arrays import Array
from emaphm.diagnosis.explanation.contradicted_rotor_zero import contradicted_zero
from emaphm.diagnosis.explanation.far_parameters import (
    far_nuisances,
    far_parameters,
    other_scales,
    several_scales,
)
from emaphm.diagnosis.explanation.followed_channels import unfollowed
from emaphm.diagnosis.explanation.known_values import contradicted_values
from emaphm.diagnosis.explanation.one_value import standing_sensors
from emaphm.diagnosis.explanation.phase_sum import phase_sum
from emaphm.diagnosis.explanation.residuals import (
    channel_residuals,
    corrected_by_switching,
    primary_residual,
    unlike_healthy,
)
from emaphm.diagnosis.explanation.sensor_scores import contradictions
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.sensors.sensor_model import sensor_of
from emaphm.estimation.uncertainty.model_error import HealthyComparison


def reasons_against(
    result: SearchResult,
    jacobians: Array,
    healthy: Mapping[str, HealthyComparison],
    seed: int,
    *,
    moves: bool,
) -> tuple[str, ...]:
    """Return why the estimate of `result` does not explain the recording, a sentence each; none if it does.

    An estimate explains a recording where all of this holds:

    1. The residual of the primary channel (a current) is one of noise, switching and the model's known error:
       r² ≤ (a σ)² + (b y)², with σ its noise and y its rms, a and b from `RESIDUAL_LIMITS`. Where the
       reference model has corrected it, r is also at most `EXPECTED_RESIDUAL` times noise or switching, or
       times the root of the sum of their squares where the noise is that of most rows.
    2. So is that of every other channel that is compared: r² ≤ c² (σ² + q²/12 + s²) + (m y)², with q the step
       that it is rounded to, s² the variance of switching, c and m from `EXPLANATION`. Of a position, y is
       the rms of its distance from where it starts.
       Where a calibration has learned the model's error in a channel, a residual that is no worse than that
       of healthy recordings is enough. Of the primary channel it is asked in place of 1, and of any channel
       where the reference model has not corrected the estimate.
    3. The model resembles every channel: r² ≤ u y² + q²/12 + s², or what is more is noise in which the
       model's signal is found again. Not asked of an actuator at rest.
    4. No nuisance is farther off than its stated prior allows, and no parameter of the unit than its
       tolerance or the standard error of its calibration. The error of a sensor may be: it is reported as a
       fault of that sensor.
    5. The residual shows no sensor that comes late, nor one of another scale or zero, beyond what the faults
       take up (`emaphm.diagnosis.explanation.sensor_scores`).
    6. No recorded load or temperature is contradicted (`emaphm.diagnosis.explanation.known_values`).
    7. Three recorded phase currents of a star add up to zero, within `phase_sum` of their size.
    8. No sensor of the current or the motion shows one value throughout where the model moves.
    9. The residual shows no electrical zero of the rotor but the position's
       (`emaphm.diagnosis.explanation.contradicted_rotor_zero`).
    10. No two sensors have another scale, each by more than `prior_deviations`: faults of sensors are rare,
       and times that are stretched change the scale of everything that moves.
    11. Of a channel whose sensor has another scale, the model explains more of the variation than of noise
        (`emaphm.diagnosis.explanation.followed_channels`).

    The fifth, sixth and ninth are asked where the reference model has corrected the estimate by its
    switching: of other drives a few percent are left of any machine, whose direction may be that of a
    sensor's. So may that of a learned error of the model, with which the fifth and ninth are not asked.

    Parameters
    ----------
    result
        The estimate, and what was minimised.
    jacobians
        Of the channels there, (n, d, channel rows).
    healthy
        The residuals next to those of healthy recordings, by channel, where they were learned.
    seed
        For the descents that some of it takes.
    moves
        Whether the actuator moved.
    """
    primary = result.objective.problem.primary
    found = [
        *(unlike_healthy(primary, healthy) if primary in healthy else primary_residual(result)),
        *channel_residuals(result, healthy, moves=moves),
        *_unfollowed(result),
        *far_nuisances(result),
        *far_parameters(result),
        *several_scales(result),
        *phase_sum(result),
        *(standing_sensors(result) if moves else ()),
    ]
    if moves and corrected_by_switching(result):
        found += contradicted_values(result, seed)
        if not healthy:
            found += contradicted_zero(result, jacobians, seed) or contradictions(result, jacobians, seed)
    return tuple(found)


def _unfollowed(result: SearchResult) -> Iterator[str]:
    scaled = {name.removesuffix("_scale") for name in other_scales(result)}
    yield from unfollowed(
        result, [one for one in result.objective.problem.channels if sensor_of(one) in scaled]
    )
