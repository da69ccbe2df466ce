"""Prognosis from the readings of an indicator: distribution of the remaining useful life, and advice."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from emaphm.arrays import Array
from emaphm.prognosis.advice import Advice, advice
from emaphm.prognosis.filter.following import follow
from emaphm.prognosis.forecast import drawn_states, paths
from emaphm.prognosis.indicator.readings import FAILING, Indicator
from emaphm.prognosis.notes.life import ENOUGH
from emaphm.prognosis.notes.receding import receding_notes
from emaphm.prognosis.notes.stress import stress_notes
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.prognose import DEFAULT_QUESTION, Question, pace_ahead
from emaphm.prognosis.requirements.first_passage import first_passage
from emaphm.prognosis.result import INTERVAL90, RemainingLife
from emaphm.prognosis.settings import FORECAST, INDICATOR_FILTER, LAWS, FilterSettings, ForecastSettings
from emaphm.prognosis.stress import STRESSES, Stress, StressReference, stress_dict
from emaphm.prognosis.wording.sentences import advice_text, hours_text
from emaphm.random_streams import stream
from emaphm.strict_json import finite
from emaphm.version import VERSION


@dataclass(frozen=True, eq=False)
class IndicatorPrognosis(RemainingLife):
    """The remaining useful life (RUL) of a unit from one indicator.

    Attributes
    ----------
    horizon
        Flight hours from now on for which `probability_of_failure` holds [h].
    sample
        Sample of the RUL, (n,) [h], `inf` without a failure in sight.
    forecast_hours, forecast
        Hours from now on, (m,) [h], and the paths of the value at these hours, (m, n), in its unit.
    laws
        Probability of each law of degradation.
    reference
        The stress to which hours refer, None if no stress was recorded.
    exponents
        Sample of the exponents of the stress, (n, 3), in the order of `STRESSES`, given all readings.
    ahead
        The given future stress.
    """

    indicator: Indicator
    horizon: float
    sample: Array = field(repr=False)
    forecast_hours: Array = field(repr=False)
    forecast: Array = field(repr=False)
    laws: dict[str, float]
    reference: StressReference | None
    exponents: Array = field(repr=False)
    advice: Advice
    seed: int
    ahead: Stress | None = None
    notes: tuple[str, ...] = ()

    @property
    def value90(self) -> tuple[float, float, float]:
        """5, 50 and 95 % quantiles of the indicator's present value, without the error of a reading."""
        low, median, high = np.quantile(self.forecast[0], (INTERVAL90[0], 0.5, INTERVAL90[1]))
        return float(low), float(median), float(high)

    def to_dict(self) -> dict[str, Any]:
        """Return the prognosis as JSON; a RUL without a failure in sight is null."""
        low, median, high = self.value90
        indicator = self.indicator
        return {
            "unit": indicator.unit,
            "hours": indicator.hours,
            "rul_hours": {"median": finite(self.median), "interval90": [finite(x) for x in self.interval90]},
            "horizon_hours": self.horizon,
            "probability_of_failure": self.probability_of_failure,
            "advice": self.advice.to_dict(indicator.hours),
            "indicator": {
                "measures": indicator.measures,
                "value": median,
                "interval90": [low, high],
                "healthy": indicator.healthy,
                "fails_at": indicator.fails_at,
                "laws": self.laws,
                "readings": len(indicator.readings),
            },
            "stress": stress_dict(self.reference, self.ahead) | {"exponents": self._exponents()},
            "notes": list(self.notes),
            "seed": self.seed,
            "version": VERSION,
        }

    def _exponents(self) -> dict[str, dict[str, Any]]:
        values = () if self.reference is None else self.reference.values
        result = {}
        for i, value in enumerate(values):
            if value is not None:
                low, median, high = np.quantile(self.exponents[:, i], (INTERVAL90[0], 0.5, INTERVAL90[1]))
                result[STRESSES[i]] = {"median": float(median), "interval90": [float(low), float(high)]}
        return result

    def __str__(self) -> str:
        low, high = (hours_text(x) for x in self.interval90)
        from_value, value, to_value = self.value90
        indicator = self.indicator
        law = max(self.laws, key=self.laws.__getitem__)
        lines = [
            f"{indicator.unit}, at {indicator.hours:.9g} h",
            f"{indicator.measures}: {value:.4g} (90 %: {from_value:.4g} to {to_value:.4g})",
            f"fails at {indicator.fails_at:.4g}",
            f"most likely law: {law} ({100 * self.laws[law]:.0f} %)",
            f"remaining useful life: {hours_text(self.median)} (90 %: {low} to {high})",
            f"probability of failure within {self.horizon:.9g} h: {100 * self.probability_of_failure:.1f} %",
            f"advice: {advice_text(self.advice, indicator.hours)}",
            *(f"note: {note}" for note in self.notes),
        ]
        return "\n".join(lines)


def prognose_indicator(
    indicator: Indicator,
    question: Question = DEFAULT_QUESTION,
    *,
    prior: Prior | None = None,
    seed: int = 0,
    filter_settings: FilterSettings = INDICATOR_FILTER,
    settings: ForecastSettings = FORECAST,
) -> IndicatorPrognosis:
    """Return the prognosis of an indicator, with the filter and the forecast of a unit's components.

    Level and rate follow one of the laws of degradation, and the time of failure is the first passage through
    the limit. A value on the other side of the healthy value than the limit is taken as healthy.

    Parameters
    ----------
    indicator
        Its readings, its healthy value and its limit.
    question
        The horizon [h], the accepted risk, costs and the future stress.
    prior
        Prior of the degradation, in levels: 0 is healthy, 0.5 is the limit; by default the general prior.
    seed
        Seed of the random streams.
    filter_settings, settings
        Settings of the filter of the readings; number and duration of the forecast paths.

    Raises
    ------
    PrognosisError
        A reading cannot be used.
    """
    prior = prior or Prior()
    settings = replace(settings, longest_hours=max(settings.longest_hours, 2 * question.horizon))
    evidence = indicator.evidence()
    belief = follow(evidence, prior, seed=seed, settings=filter_settings, past=()).belief
    state = drawn_states(belief, settings.paths)
    pace = pace_ahead(state, belief, evidence, question.ahead)
    forecast_paths = paths(state, belief.prior, seed=seed, pace=pace, settings=settings)
    level = forecast_paths.level[:, :, 0]
    sample = first_passage(
        forecast_paths.hours,
        FAILING - level,
        forecast_paths.noise[:, :, 0],
        stream(seed, "forecast", "first passage"),
    )
    notes = [*stress_notes(question.ahead, belief.prior.reference), *receding_notes(indicator)]
    if len(indicator.readings) < ENOUGH:
        notes.append(
            f"readings: {len(indicator.readings)}; {ENOUGH} are needed to estimate a rate, until then the "
            "prognosis mostly follows from the prior"
        )
    return IndicatorPrognosis(
        indicator=indicator,
        horizon=question.horizon,
        sample=sample,
        forecast_hours=forecast_paths.hours,
        forecast=indicator.value(level),
        laws=dict(zip(LAWS, belief.law_probabilities()[0].tolist(), strict=True)),
        reference=belief.prior.reference,
        exponents=state.exponents[:, 0],
        advice=advice(
            sample, question.horizon, risk=question.risk, age=indicator.hours, costs=question.costs
        ),
        seed=seed,
        ahead=question.ahead,
        notes=tuple(notes),
    )
