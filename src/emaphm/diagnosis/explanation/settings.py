"""What counts as an explanation of a recording."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ResidualSettings:
    """The largest residual of the current that is accepted: `noise` and `model` add by squares.

    `noise` is a multiple of the white noise on the recording, `model` a share of the current's rms.
    """

    noise: float
    model: float


RESIDUAL_LIMITS = {False: ResidualSettings(1.5, 0.05), True: ResidualSettings(1.25, 0.02)}
"""Without and with correction by the reference model. On recordings that the reference model made itself,
the corrected residual was up to 1.17 times the noise."""


@dataclass(frozen=True)
class ExplanationSettings:
    """What else an estimate has to fulfil, to explain a recording; `make study` (spoilt) measures it.

    A noise that is measured on the recording counts up to `spikes` times what most of the rows show.

    A channel other than the primary one may have a residual of `channel_model` of its rms
    (`uncorrected_model` where the reference model was not asked), and of `channel_noise` times its noise,
    rounding and switching.
    Beyond rounding and switching, the residual may be no more than `unresembled` of every channel's mean
    square: a noise that is measured on the recording itself would otherwise excuse a model that resembles
    nothing. Where it is more, the model's signal must be found in the recorded one again, to
    `drowned_errors` standard errors.

    A nuisance may be `prior_deviations` standard deviations of its prior off, where the description states
    that prior; a prior that is merely usual, as the load's, says nothing against a larger one. So may a
    parameter with a tolerance or of the unit's calibration.

    Phase currents may add up to `phase_sum` of their rms, and to `channel_noise` times the noise of the sum.
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
