"""Limits for testing and keeping nuisances, sensor errors, parameters and laws without a request."""

from dataclasses import dataclass

from emaphm.estimation.sensors.sensor_model import sensor_error

ROTOR_ZERO = "rotor_zero"
"""The parameter of the description, as `emaphm.actuator.unit.baseline` names it."""

MOTOR = ("torque_constant", "inductance", "resistance")
"""Parameters of the motor that are estimated together."""

SPEED_CONTROL = ("speed_gain", "integral_gain")
CURRENT_CONTROL = ("current_gain", "current_integral_gain")
"""Gains of the control loops."""


@dataclass(frozen=True)
class NuisanceSelectionSettings:
    """Limits for nuisances to be tried and kept; `make study` (limits, inertia, supply) measures them.

    Tried: a score above `tried_score` standard errors, and less than `tried_share` of the mean squared
    residual after descents. Scores are unreliable because the derivatives are those at a wrong estimate: with
    5 % of inertia they were 1.6 to 7 where the line voltage was recorded, and up to 4 with the actuator as
    described. Descents separate the two: with 5 % of inertia the share was at most 0.998, mostly 0.98; as
    described 0.996 and more, except in 1 recording of 100.

    Kept: a deviation of `certain_score` standard errors with a smaller residual, or of `likely_score` with
    less than `likely_share` of the residual. In the latter case a profiled nuisance needs no score, because
    its scatter is large where searches end at kinks. With 5 % of inertia, the share after estimation was 0.65
    to 0.95; with the actuator as described at least 0.96, by chance. Switching alone changes the share up to
    `equal_share`: for a parameter of the actuator, a certain score decides within this limit. The deviation
    must also exceed `least_deviation`, a share of the prior's standard deviation: smaller ones are usual.

    The standard error due to the data must be below `informative`, in standard deviations of the prior. The
    prior of a tried nuisance is `widening` times as wide, because it would otherwise shrink a large
    deviation.
    """

    tried_score: float = 1.0
    tried_share: float = 0.995
    certain_score: float = 3.0
    likely_score: float = 1.5
    likely_share: float = 0.95
    equal_share: float = 1.03
    least_deviation: float = 0.5
    informative: float = 1.0
    widening: float = 4.0
    descents: int = 2


SELECTION = NuisanceSelectionSettings()


@dataclass(frozen=True)
class SensorSelectionSettings:
    """Other limits for sensor errors, which may have any size and are of many kinds.

    Tried: the `most_tried` largest scores of at least `tried_score`. Even large errors have scores of only 2
    to 5 if the search has compensated for them by faults: 2.2 to 3.7 for delays of 1 to 5 rows, 6 for a
    voltage × 0.5, 5 for a current × 1.2 (3 random fault vectors each). Descents separate them. With a score
    above `sure_score`, descents need not reduce the residual much, because shorts compensate for a voltage ×
    1.02: its score was 3.6 to 14 in 7 of 8 recordings, at most 1.8 without it, with a share of the residual
    of 0.993 to 0.997. If shorts have already compensated for it, its score is small and that of another error
    large: it is therefore tried if any score is above `sure_score`, with a share below `made_up_share`. After
    its own correction the share was 0.88 to 0.95, and 0.98 to 0.99 where the scale was right.

    Priors are `widening` times as wide, those of delays `delay_widening` times: flat over all sizes that can
    occur, up to 11 times the scale, or 20 rows of delay at 5 kHz. A search starts within `search_widening`
    times the prior: 15 % of scale, 3 ms of delay, and twice these values.

    The standard error due to the data, at the estimate without the error, must be below `informative`
    standard deviations of the prior; a wrong estimate also makes standard errors large.

    If a factor reduces the rms residual of a channel to less than `gross_share`, descents start at that
    factor: a reversed sensor is outside the range of the linear model.

    Of the candidates whose descents end within `rival_share` times the smallest residual, the one with the
    smallest residual after its own correction is kept, because errors of different channels have similar
    effects. If its residual still exceeds the expected size, it must be less than `excess_share` of that
    before.

    An unnecessary parameter reduces the mean squared residual by χ² / rows with one degree of freedom, where
    rows over which the residual is correlated count as one. For all seventeen errors, χ² stays below `chance`
    in 99 of 100 recordings. A delay must also exceed `least_rows` of a row: in slow rows, the course of a
    signal between rows is not known better.
    """

    tried_score: float = 1.8
    sure_score: float = 3.0
    made_up_share: float = 1.01
    most_tried: int = 3
    widening: float = 250.0
    delay_widening: float = 5.0
    informative: float = 10.0
    gross_share: float = 0.6
    search_widening: float = 15.0
    most_corrected: int = 3
    rival_share: float = 1.5
    excess_share: float = 0.5
    chance: float = 12.0
    least_rows: float = 0.1


SENSOR_SELECTION = SensorSelectionSettings()


@dataclass(frozen=True)
class DescriptionErrorSettings:
    """Limits for estimating parameters of the description without a request, and their priors.

    The motor is tested if the score test gives a deviation of the inductance of more than `least`, relative,
    and `likely` standard errors; above `certain` standard errors an equal residual is enough. Of 40
    recordings of an actuator as described, with current and line voltage, one had more than 1.5 standard
    errors (2.3); of 16 with random faults and a torque constant 10 % off, 12 had. `prior` is the standard
    deviation of a parameter's logarithm, `step` the change of the logarithm of the inductance for its
    derivative. `zero_prior` is the standard deviation of the rotor's zero, in units of
    `parameter_variation.sizes`: 0.3 rad, for a zero anywhere within a sixth of a turn. `control_prior` is
    that of the logarithm of a gain, which drives have in their own units.
    """

    least: float = 0.03
    likely: float = 1.5
    certain: float = 2.5
    prior: float = 0.1
    step: float = 0.02
    zero_prior: float = 1.2
    control_prior: float = 0.5

    def prior_of(self, parameter: str) -> float:
        """Return the prior standard deviation of a parameter that is estimated without a request."""
        if parameter in (*SPEED_CONTROL, *CURRENT_CONTROL):
            return self.control_prior
        return self.zero_prior if parameter == ROTOR_ZERO else self.prior


DESCRIPTION_ERRORS = DescriptionErrorSettings()


@dataclass(frozen=True)
class ControlErrorSettings:
    """Limits for testing gains of the control, and for keeping them and laws of the control.

    Gains are tested if the score test gives a deviation of a gain of the current control of more than
    `least`, relative, and `likely` standard errors; above `certain` standard errors any smaller residual is
    enough. With current and line voltage, 1 of 40 recordings of a PMSM and a six-step drive as described had
    a score (1.3); of 40 with gains 5 to 30 % off and an expected residual, 2 had less than 2. If the residual
    exceeds the expected size with and without the gains, its mean square must fall below `excess_share`. A
    law of the control is kept if the normalised residual is below `convincing`. From the current alone, a
    deviation of the logarithm of the speed gain of more than `most_alone` is rejected: wrong gear ratios have
    such large effects. `step` is the change of a logarithm for a derivative.
    """

    least: float = 0.02
    likely: float = 2.0
    certain: float = 3.0
    excess_share: float = 0.5
    convincing: float = 1.0
    most_alone: float = 0.6
    step: float = 0.05


CONTROL_ERRORS = ControlErrorSettings()


@dataclass(frozen=True)
class LawSelectionSettings:
    """Limits for laws to be tried and kept; `make study` (limits, plants) measures the effect.

    Laws are tried while the residual exceeds the expected size. All laws are fitted with the averaged model,
    by a global search and from the estimate; the `corrected` best laws of both are also corrected by the
    reference model. A law is kept if less than `share` of the mean squared residual remains; at most `most`
    laws are kept.

    A residual is clearly smaller if it is less than the share `clearly_less` of another: chance seldom has
    this effect (0.92 to 1.03 in three recordings). An estimate with a law, or with a varying load, is refined
    only if its residual is clearly smaller than that without. If the residual exceeds the expected size, a
    lag of the current sensors is tried further only if the residual with one of the first lags is clearly
    smaller.

    A second friction law is also tried if the residual with the first is expected. It is kept with a share
    below `clearly_less`, and only if it acts: if a law has no effect with all its parameters at 0, one of
    them must be `significant` standard errors from 0.
    """

    corrected: int = 2
    share: float = 0.8
    clearly_less: float = 0.95
    significant: float = 2.0
    most: int = 4


LAW_SELECTION = LawSelectionSettings()


def widening(name: str) -> float:
    """Return the factor by which the prior of a tried nuisance is wider than described."""
    error = sensor_error(name)
    if error is None:
        return SELECTION.widening
    return SENSOR_SELECTION.delay_widening if error[1] == "delay" else SENSOR_SELECTION.widening
