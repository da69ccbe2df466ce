"""When a nuisance that nobody named is tried, and when it is kept."""

from dataclasses import dataclass

from emaphm.estimation.sensors.sensor_model import sensor_error

ROTOR_ZERO = "rotor_zero"
"""The parameter of the description, as `emaphm.actuator.unit.baseline` names it."""

MOTOR = ("torque_constant", "inductance", "resistance")
"""Parameters of the windings, which are asked for together."""

SPEED_CONTROL = ("speed_gain", "integral_gain")
CURRENT_CONTROL = ("current_gain", "current_integral_gain")
"""Gains of the control loops."""


@dataclass(frozen=True)
class NuisanceSelectionSettings:
    """When a nuisance is tried, and when it is kept; `make study` (limits, inertia and supply) measures them.

    Tried: a score above `tried_score` standard errors, and descents that leave less than `tried_share` of the
    mean squared residual. Derivatives at a wrong estimate make scores unreliable: 5 % of inertia had 1.6 to 7
    where line voltage was recorded, the actuator as described up to 4. Descents separate them: with 5 % of
    inertia they left 0.998 at most, 0.98 mostly; as described 0.996 and more, but for 1 recording in 100.

    Kept: an estimate `certain_score` standard errors off nominal with a smaller residual, or `likely_score`
    with less than `likely_share` of it, for which a profiled one needs no score: the kinks that a search
    ends at make its scatter large. 5 % of inertia, once estimated, left 0.65 to 0.95; the actuator as
    described no less than chance, 0.96. Chance is switching, up to `equal_share`: of what belongs to the
    actuator, a certain score decides within it. It must also be off by `least_deviation`, a share of its
    prior's standard deviation: less is expected of every actuator.

    The data must determine the nuisance to `informative`, a share of its prior's standard deviation.
    The prior of what is tried is `widening` times as wide: it would otherwise shrink a large deviation.
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
    """What is different for errors of sensors: faults of a sensor are of any size, and there are many kinds.

    Tried: the `most_tried` of the largest scores, `tried_score` at least. Even large faults score no more
    than 2 to 5 where the search has bent the actuator's faults to them: 1 to 5 rows of delay 2.2 to 3.7, a
    voltage × 0.5 6, a current × 1.2 5 (3 random fault vectors each). Descents separate them; of a score above
    `sure_score` they need not leave much less, since shorts make up for a voltage × 1.02: its score was 3.6
    to 14 in 7 of 8 recordings, 1.8 at most without it, and they left 0.993 to 0.997. Where shorts have made
    up for it before, its own score is small and that of another error large: it is tried wherever one is
    above `sure_score`, and need not leave less than `made_up_share`. Its own correction then left 0.88 to
    0.95, and 0.98 to 0.99 where the scale was right.

    Priors are `widening` times as wide, those of delays `delay_widening`: flat for whatever can be recorded,
    up to 11 times the scale, 20 rows of a delay at 5 kHz. A search begins within `search_widening` times the
    prior: 15 % of scale, 3 ms of delay, and twice that.

    The data must determine one to `informative` prior standard deviations at the estimate without it, where a
    wrong estimate makes standard errors large too.

    Where a factor leaves less than `gross_share` of a channel's rms residual, descents begin at that factor:
    a reversed sensor is beyond what the derivatives show.

    Of candidates whose descents leave up to `rival_share` times the least residual, that with the least one
    after its own correction is kept: errors of one channel look like those of another. One whose residual
    still exceeds what is expected has to leave less than `excess_share` of that before.

    A parameter that is not needed removes χ² / rows of the mean squared residual, with one degree of freedom,
    the rows over which the residual is correlated counting as one.
    Of the seventeen errors, none exceeds `chance` in 99 of 100 recordings. A delay is also more than
    `least_rows` of a row: of slow rows, how a signal runs between them is known no better.
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
    """When the motor's parameters are asked for, and what is known of what is asked for.

    The inductance by the score test is off by more than `least`, relative, and `likely` standard errors; more
    than `certain` ones decide by themselves, where the residual does not become larger. Of 40 recordings of
    an actuator as described, with current and line voltage, one had more than 1.5 (2.3); of 16 with random
    faults whose torque constant was a tenth off, 12 had. `prior` is the standard deviation of a parameter's
    logarithm, `step` the change of the inductance's for its derivative. `zero_prior` is that of the rotor's
    zero, in units of `parameter_variation.sizes`: 0.3 rad, of one that is anywhere within a sixth of a turn.
    `control_prior` is that of a gain's logarithm, which drives have in units of their own.
    """

    least: float = 0.03
    likely: float = 1.5
    certain: float = 2.5
    prior: float = 0.1
    step: float = 0.02
    zero_prior: float = 1.2
    control_prior: float = 0.5

    def prior_of(self, parameter: str) -> float:
        """Return the standard deviation of a parameter's coordinate, where it is estimated unasked."""
        if parameter in (*SPEED_CONTROL, *CURRENT_CONTROL):
            return self.control_prior
        return self.zero_prior if parameter == ROTOR_ZERO else self.prior


DESCRIPTION_ERRORS = DescriptionErrorSettings()


@dataclass(frozen=True)
class ControlErrorSettings:
    """When gains of the control are asked for, and when they and laws of the control are kept.

    A gain of the current control by the score test is off by more than `least`, relative, and `likely`
    standard errors; beyond `certain` ones a new search need only leave less. With current and line voltage 1
    of 40 recordings of a PMSM and a six-step drive as described had a score (1.3), of 40 with gains 5 to 30 %
    off whose residual was expected 2 had less than 2. Where the residual exceeds what is expected, gains with
    which it still does must leave less than `excess_share` of its mean square; a law of the control is
    kept with a normalised residual below `convincing`. From one channel alone, a current, the logarithm of
    the speed gain is off by `most_alone` at most: gear ratios are wrong by larger factors. `step` is that of
    the logarithm for a derivative.
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
    """When laws are tried, and which are kept; `make study` (limits, plants) measures them.

    Tried while the residual exceeds what is expected. All laws are fitted by the averaged model, from afar
    and from the estimate; the `corrected` best of each also with a correction of their own. One is kept that
    leaves less than `share` of the mean squared residual; `most` laws at most.

    An estimate leaves clearly less than another one where it leaves less than the share `clearly_less` of its
    residual: chance alone seldom does (0.92 to 1.03 of three recordings). An estimate with a law, or with a
    load that varies, is refined only where it leaves clearly less than the one without. Where the residual is
    not expected before a lag of the current sensors is tried, one of the first lags must leave clearly less.

    A second law of the friction is also tried where the residual with the first is expected. It is kept with
    less than `clearly_less`, and only if it acts: where a law has no effect with all of its parameters 0, one
    of them is `significant` standard errors from it.
    """

    corrected: int = 2
    share: float = 0.8
    clearly_less: float = 0.95
    significant: float = 2.0
    most: int = 4


LAW_SELECTION = LawSelectionSettings()


def widening(name: str) -> float:
    """Return how many times as wide as the description's the prior of a tried nuisance is."""
    error = sensor_error(name)
    if error is None:
        return SELECTION.widening
    return SENSOR_SELECTION.delay_widening if error[1] == "delay" else SENSOR_SELECTION.widening
