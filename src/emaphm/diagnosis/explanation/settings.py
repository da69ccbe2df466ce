"""Limits within which an estimate explains a recording."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ResidualSettings:
    """Largest accepted residual of the current: `noise` and `model` add by squares.

    `noise` is a multiple of the white noise on the recording, `model` a share of the current's rms.
    """

    noise: float
    model: float


RESIDUAL_LIMITS = {False: ResidualSettings(1.5, 0.05), True: ResidualSettings(1.25, 0.02)}
"""Without and with correction by the reference model. On recordings that the reference model made itself,
the corrected residual was up to 1.17 times the noise."""


@dataclass(frozen=True)
class ExplanationSettings:
    """Further conditions for an estimate to explain a recording; `make study` (spoilt) measures the effect.

    A noise that is measured on the recording counts up to `spikes` times the noise of most rows.

    A channel other than the primary one may have a residual of `channel_model` of its rms
    (`uncorrected_model` without corrections by the reference model), and of `channel_noise` times its noise,
    rounding and switching.
    Beyond rounding and switching, the squared residual may be at most `unresembled` of the mean square of any
    channel: otherwise a noise that is measured on the recording would excuse a model that does not resemble
    the channel. A larger residual is accepted if the channel contains the model's signal, within
    `drowned_errors` standard errors.

    A nuisance may be `prior_deviations` standard deviations of its prior from nominal, if the description
    states that prior; a default prior, such as that of the load, does not exclude larger values. The same
    limit applies to parameters with a tolerance or a calibration.

    The sum of the phase currents may be `phase_sum` of their rms plus `channel_noise` times its noise.
    """

    spikes: float = 1.5
    channel_noise: float = 1.5
    channel_model: float = 0.05
    uncorrected_model: float = 0.15
    unresembled: float = 0.5
    drowned_errors: float = 2.0
    prior_deviations: float = 3.0
    phase_sum: float = 0.05


EXPLANATION = ExplanationSettings()
