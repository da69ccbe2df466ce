"""Settings of the prognosis, with units and reasons for their values."""

from dataclasses import dataclass, replace

LAWS = (
    "constant",
    "linear",
    "exponential",
    "power law",
    "sudden onset",
    "changing rate",
    "crack growth",
    "as another unit",
)
"""Laws of degradation; the number of a law is its index here."""

CONSTANT, LINEAR, EXPONENTIAL, POWER_LAW, SUDDEN_ONSET, CHANGING_RATE, CRACK_GROWTH, AS_ANOTHER = range(
    len(LAWS)
)


@dataclass(frozen=True)
class DegradationSettings:
    """Prior of the degradation of a component, before any diagnosis.

    `laws` are the prior probabilities of the law, in the order of `LAWS` without the last law, which needs a
    fleet. A constant level must be the most likely single case, because most components of most units do not
    degrade. `life_scale` [h] is the time T in which the level changes by about one, uniform in the logarithm:
    from a component that is worn out in a few hundred hours to a component that outlives the aircraft's
    60,000 flight hours. `exponent` is that of the power law, from running-in to accelerating wear; `growth`
    is the time constant of the exponential law as a share of T. `crack` is 1 / (m - 1) for growth by the
    power m of a crack's length: Paris's exponents of 3 to 7, which are halved for a length; T is the age at
    which the crack is infinite.

    `noise` is the standard deviation of a level from its law over T, by a Wiener process; without degradation
    it is multiplied by `quiet`: 0.02 in 1,000 h at most. `rate_noise` is the standard deviation of a changing
    rate, as a share of 1/T. All three are multiplied by the component's roughness, drawn from `roughness`,
    uniform in the logarithm, which distinguishes even from uneven wear. `unevenness` is the standard
    deviation of the ageing within T, as a share of T, with independent contributions of each hour: stress
    that nobody records, or jumps. It scatters a level in proportion to its rate, so that the scatter under an
    accelerating law is largest at the end. A share of 0.2 is a gamma process of 25 jumps.

    `spreads` are standard deviations between units with the same course of degradation: of the logarithm of
    the time, and of the amplitude as a share. The pairs are equally likely, from nearly equal units to units
    whose lives differ by half.

    `change_hours` [h] is the mean time after which a component changes its law: longer than most lives, so
    that it affects few forecasts. `breaks` is the mean number of sudden changes of a nonzero rate within T,
    by a factor whose logarithm has the standard deviation `break_factor`: a coating has worn through, a
    bearing's cage is broken, a seal has settled.

    `exponents` are the ranges, with uniform probability, of the exponents of load, temperature (per 10 K) and
    cycles in `StressReference`: from no effect to somewhat more than the cubic law of rolling bearings (ISO
    281); from wear that warm oil reduces to somewhat more than the doubling each 10 K of chemical ageing;
    from wear by the hour to wear by the cycle.

    `new_level` is the standard deviation of a new component's level about the healthy value, according to
    differences between baselines of units and diagnoses of healthy recordings.

    All values are chosen, not fitted: no histories of a fleet were available.
    `python -m tests.prognosis.calibration` measures predictions with these values on synthetic units, whose
    laws are not drawn from this prior. `python -m tests.prognosis.ways` measures them by the course of the
    level; the laws' probabilities and the breaks were chosen on other units with such courses.
    """

    laws: tuple[float, ...] = (0.4, 0.05, 0.15, 0.05, 0.1, 0.1, 0.15)
    life_scale: tuple[float, float] = (200.0, 60_000.0)
    exponent: tuple[float, float] = (0.5, 3.0)
    growth: tuple[float, float] = (0.15, 1.0)
    crack: tuple[float, float] = (0.4, 2.0)
    noise: float = 0.03
    quiet: float = 0.2
    rate_noise: float = 0.3
    roughness: tuple[float, float] = (0.1, 5.0)
    unevenness: tuple[float, float] = (0.003, 0.2)
    spreads: tuple[tuple[float, float], ...] = ((0.1, 0.05), (0.2, 0.1), (0.4, 0.1), (0.4, 0.3))
    change_hours: float = 20_000.0
    breaks: float = 1.0
    break_factor: float = 0.8
    new_level: float = 0.03
    exponents: tuple[tuple[float, float], ...] = ((0.0, 4.0), (-0.3, 0.9), (0.0, 1.0))
    first_hours: float = 1.0
    """Age [h] at which a power law begins: at age 0 its rate may be infinite."""


@dataclass(frozen=True)
class FilterSettings:
    """Size of the particle filter.

    `particles` is the number of particles: with 1,000, an update takes 5 to 8 ms on one core. A short history
    has more particles, up to `most`, because few of a thousand fit a short life; the number of particles
    times the number of updates is `in_all`. For a component that wore by 0.04 in an hour, with six diagnoses,
    three of six seeds lost it with 1,000 particles, none of ten with 4,000. The scatter between seeds of the
    median RUL, with eight diagnoses, was 18 % with 1,000 and 11 % with 3,125 particles for a unit with
    accelerating wear, and 1 % with 1,000 for a unit with even wear
    (`python -m tests.prognosis.calibration --seeds 6`).

    Particles are resampled if their effective number is less than `effective_share` of their number, usually
    a half. Copies are then jittered by the kernel of Liu and West with `shrinkage`, usually 0.98, in the
    logarithms of life scale, shape, roughness and unevenness, with a spread of at least `least_spread`.
    Exponents of the stress are jittered by `exponent_jitter` of their range.

    The likelihood that weights laws and parameters is raised to the power `trust`, below 1, because a
    component's true law may not be in the filter, and then the most likely of the wrong laws must not
    dominate [1]; level and rate, given the law, use the full likelihood. 0.7 was chosen on the synthetic
    fleet `development`: at three quarters of life, 90 % intervals contained the true value in 78 % with a
    trust of 1, in 90 % with 0.7.

    A diagnosis of a component is an outlier with probability `outliers`, and the level has jumped since the
    previous diagnosis with probability `jumps`; `surprise` is the standard deviation of both, a third of the
    full range. Both are rare: few diagnoses have errors of many standard errors, and few components break
    suddenly. `python -m tests.prognosis.ways` measures forecasts of units with neither. After a jump, a level
    that was changing keeps its law and rate with the probability `law_kept`: a shock may add to the wear and
    leave its mechanism as it was, or start another. A level at rest has no rate to keep.

    [1] Grünwald, van Ommen: Inconsistency of Bayesian inference for misspecified linear models, and a
        proposal for repairing it, Bayesian Analysis 12 (2017).
    """

    particles: int = 1000
    most: int = 4000
    in_all: int = 25_000
    effective_share: float = 0.5
    shrinkage: float = 0.98
    least_spread: float = 0.05
    exponent_jitter: float = 0.05
    trust: float = 0.7
    outliers: float = 0.003
    jumps: float = 0.001
    surprise: float = 0.3
    law_kept: float = 0.5

    def for_updates(self, updates: int) -> "FilterSettings":
        """Return the settings for a history with that number of `updates`: fewer updates, more particles."""
        affordable = min(self.in_all // max(updates, 1), self.most)
        return replace(self, particles=max(self.particles, affordable))


@dataclass(frozen=True)
class ForecastSettings:
    """Size and duration of the forecast.

    `paths` is the number of paths; with 1,000, a probability of 5 % has a standard error of 0.7 %.
    `longest_hours` [h] is the duration; a longer RUL is "no failure in sight". The `steps` time steps grow
    from `first_step` [h]; crossings within a step are drawn exactly for a level (`first_passage`).
    """

    paths: int = 1000
    longest_hours: float = 20_000.0
    first_step: float = 2.0
    steps: int = 120


INDICATOR_FILTER = FilterSettings(particles=20_000)
"""Settings for one indicator: an update takes about 10 ms, because a particle has one component instead of
eight. After a jump, few of a thousand particles would fit, and the RUL would depend on the seed."""

DEGRADATION = DegradationSettings()
FILTER = FilterSettings()
FORECAST = ForecastSettings()
