"""Conditions under which an estimate explains a recording, and reasons if it does not."""

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
    """Return sentences on why the estimate of `result` does not explain the recording; none if it does.

    An estimate explains a recording if all of these conditions hold:

    1. The residual r of the primary channel (a current) is no larger than noise, switching and the model's
       known error allow: r² ≤ (a σ)² + (b y)², with σ its noise and y its rms, a and b from
       `RESIDUAL_LIMITS`. Where the reference model has corrected it, r is also at most `EXPECTED_RESIDUAL`
       times noise or switching, or times the root of the sum of their squares, with the noise of most rows.
    2. The residual of every other compared channel fulfils r² ≤ c² (σ² + q²/12 + s²) + (m y)², with q the
       step that it is rounded to, s² the variance of switching, c and m from `EXPLANATION`. For a position, y
       is the rms of its distance from its start.
       Where a calibration has learned the model's error in a channel, it is enough that the residual is no
       worse than in healthy recordings. For the primary channel this condition replaces 1; it also applies
       to every channel where the reference model has not corrected the estimate.
    3. The model resembles every channel: r² ≤ u y² + q²/12 + s², or the excess is noise that contains the
       model's signal. This does not apply to an actuator at rest.
    4. No nuisance is farther from nominal than its stated prior allows, and no parameter of the unit farther
       than its tolerance or the standard error of its calibration allows. Sensor errors are excepted: they
       are reported as faults of sensors.
    5. The residual indicates no delay, and no other scale or zero of a sensor, in addition to the estimate
       (`emaphm.diagnosis.explanation.sensor_scores`).
    6. No recorded load or temperature is contradicted (`emaphm.diagnosis.explanation.known_values`).
    7. Three recorded phase currents of a star add up to zero, within `phase_sum` of their rms.
    8. No sensor of current or motion is constant while the model moves.
    9. The residual does not indicate another electrical zero of the rotor
       (`emaphm.diagnosis.explanation.contradicted_rotor_zero`).
    10. No two sensors have another scale, each by more than `prior_deviations`: faults of sensors are rare,
       and a stretched time axis changes the scales of several channels.
    11. For a channel whose sensor has another scale, the model explains more of the variation than of noise
        (`emaphm.diagnosis.explanation.followed_channels`).

    Conditions 5, 6 and 9 apply where the reference model has corrected the estimate by its switching: for
    other drives a residual of a few percent remains for any machine, which may have the direction of a sensor
    error. So may a learned error of the model, with which conditions 5 and 9 do not apply.

    Parameters
    ----------
    result
        The estimate, with its objective.
    jacobians
        Jacobians of the channels at the estimate, (n, d, channel rows).
    healthy
        Comparison of the residuals with healthy recordings, by channel, where these were learned.
    seed
        Seed of the descents of some tests.
    moves
        Whether the actuator moved.
    """
    primary = result.objective.problem.primary
    reasons = [
        *(unlike_healthy(primary, healthy) if primary in healthy else primary_residual(result)),
        *channel_residuals(result, healthy, moves=moves),
        *_unfollowed_scaled_channels(result),
        *far_nuisances(result),
        *far_parameters(result),
        *several_scales(result),
        *phase_sum(result),
        *(standing_sensors(result) if moves else ()),
    ]
    if moves and corrected_by_switching(result):
        reasons += contradicted_values(result, seed)
        if not healthy:
            reasons += contradicted_zero(result, jacobians, seed) or contradictions(result, jacobians, seed)
    return tuple(reasons)


def _unfollowed_scaled_channels(result: SearchResult) -> Iterator[str]:
    """Yield a sentence on each channel with another scale that does not follow its quantity."""
    scaled = {name.removesuffix("_scale") for name in other_scales(result)}
    yield from unfollowed(
        result, [channel for channel in result.objective.problem.channels if sensor_of(channel) in scaled]
    )
