"""What tunes the prognosis, each number with its unit and why it has this value."""

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
"""Laws of degradation; the number of a law is its place here."""

CONSTANT, LINEAR, EXPONENTIAL, POWER_LAW, SUDDEN_ONSET, CHANGING_RATE, CRACK_GROWTH, AS_ANOTHER = range(
    len(LAWS)
)


@dataclass(frozen=True)
class DegradationSettings:
    """Prior of the degradation of a component, before any of it is seen.

    The law has the prior probabilities `laws`, in the order of `LAWS`, the last of which only a fleet can
    teach: a component that stays as it is must be the likeliest single case, as most components of most units
    are. `life_scale` [h] is the time T in which the level changes by about one, its logarithm uniform:
    from a component that is worn out in some hundred hours to one that outlives the aircraft's 60,000
    flight hours. `exponent` is that of the power law, from running-in to accelerating wear; `growth` the
    time constant of the exponential law as a share of T. `crack` is 1 / (m - 1) for growth by the power m
    of a crack's length: Paris's exponents of 3 to 7, which are halved for a length; T is the age at which
    it is infinite. `noise` is the standard deviation by which a level deviates from its law over T, by a
    Wiener process; `quiet` what is left of it where nothing degrades: 0.02 in 1,000 h at most.
    `rate_noise` is that of a changing rate, as a share of 1/T. All three are multiplied by the
    component's roughness, drawn from `roughness` with its logarithm uniform: what wears evenly is
    distinguished from what does not. `unevenness` is the standard deviation of the ageing within T, as a
    share of T, of which each hour has its independent part: stress that nobody records, or jumps. It
    scatters a level in proportion to its rate, so that a law that accelerates scatters most at its end. A
    share of 0.2 is a gamma process of 25 jumps.
    `spreads` are standard deviations between units that go the same way, of the logarithm of the time and of
    the amplitude as a share, each pair as likely: from units that are nearly alike to such whose lives differ
    by half.
    `change_hours` [h] is the mean time after which a component takes up another law: longer than most lives,
    so that it changes few forecasts. `breaks` is how often within T the rate of what moves changes at once,
    on average, by a factor whose logarithm has the standard deviation `break_factor`: a coating has worn
    through, a bearing's cage has gone, a seal has settled.
    `exponents` are the ranges, all equally likely, of those of load, temperature (per 10 K) and cycles in
    `StressReference`: from no effect to somewhat more than the cubic law of rolling bearings (ISO 281); from
    wear that warm oil reduces to somewhat more than the doubling each 10 K of chemical ageing; from
    wear by the hour to wear by the cycle.
    `new_level` is the standard deviation of a new component's level about the healthy value: what baselines
    of units differ by, and diagnoses of healthy recordings show.

    All are chosen, not fitted: no fleet's histories were at hand. `python -m tests.prognosis.calibration`
    measures predictions with them on synthetic units, whose laws are not drawn from this prior.
    `python -m tests.prognosis.ways` does so by the way that a level goes; the laws' probabilities and the
    breaks were chosen on other units of such ways.
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

    `particles` is the number of banks: with 1,000, an update takes 5 to 8 ms on one core. Of a short history
    there are more, `in_all` of them in all its updates together, up to `most`: few of a thousand draws fit a
    short life. Where a component wore by 0.04 in an hour, with six diagnoses, three of six seeds lost it with
    1,000, none of ten with 4,000. From seed to seed the median of the RUL of a unit whose wear accelerates,
    with eight diagnoses, scattered by 18 % with 1,000, by 11 % with 3,125; that of one that wears evenly by
    1 % with 1,000 (`python -m tests.prognosis.calibration --seeds 6`).
    Resampled where fewer than `effective_share` of them carry the weight, the usual half. After it, copies
    differ again by a kernel of Liu and West with `shrinkage`, their usual 0.98, in the logarithms of life
    scale, shape, roughness and unevenness, whose spread it takes as at least `least_spread`. Exponents of
    the stress differ by `exponent_jitter` of their range. The likelihood by which laws and parameters are
    weighted is taken to the power `trust`, below 1 since a component's law may be none of the filter's, and
    the likeliest of wrong laws must not be believed alone [1]; level and rate within a law are updated in
    full. 0.7 was chosen on the synthetic fleet `development`: there, intervals of 90 % held the truth in 78 %
    at three quarters of life with a trust of 1, in 90 % with 0.7.
    A diagnosis of a component is an outlier with the probability `outliers`, and with `jumps` its level has
    jumped since the one before; `surprise` is the standard deviation of either, a third of the whole range.
    Both are rare: few diagnoses are wrong by many of their standard errors, and few components break at
    once. `python -m tests.prognosis.ways` measures forecasts of units that have neither.

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

    def for_updates(self, updates: int) -> "FilterSettings":
        """Return the settings for a history of this many `updates`: the fewer, the more particles."""
        affordable = min(self.in_all // max(updates, 1), self.most)
        return replace(self, particles=max(self.particles, affordable))


@dataclass(frozen=True)
class ForecastSettings:
    """Size and reach of the forecast.

    `paths` drawn from the filter: a probability of 5 % is then right to 0.7 % (one standard error).
    `longest_hours` [h] is how far is looked; a RUL beyond is "no failure in sight". `steps` grow from
    `first_step` [h]: crossings between two of them are drawn exactly for a level (`first_passage`).
    """

    paths: int = 1000
    longest_hours: float = 20_000.0
    first_step: float = 2.0
    steps: int = 120


INDICATOR_FILTER = FilterSettings(particles=20_000)
"""Of one indicator: an update takes 10 ms too, since a particle has one component instead of eight. A jump
after which few of a thousand particles fit would else leave the RUL to chance."""

DEGRADATION = DegradationSettings()
FILTER = FilterSettings()
FORECAST = ForecastSettings()
