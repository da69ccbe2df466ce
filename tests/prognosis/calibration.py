"""Metrics of RUL predictions for synthetic units: `python -m tests.prognosis.calibration [--units N]`."""

import argparse

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.requirements import Requirement
from emaphm.prognosis import Prognosis, Question, prognose
from emaphm.prognosis.metrics import (
    Prediction,
    alpha_lambda,
    brier,
    coverage,
    crps,
    late_prediction_rate,
    probability_integral_transform,
)

from .synthetic import KNOWN, LIMIT, UNKNOWN, Truth, observed, truth

SHARES = (0.5, 0.75)
LONGEST = 20_000.0
HORIZON = 200.0
ACTUATOR = Actuator.thesis().model_copy(
    update={
        "requirements": tuple(
            Requirement(component=component, at_most=LIMIT) for component in ("friction", "backlash")
        )
    }
)


def prediction(unit: Truth, share: float, seed: int = 0) -> Prognosis:
    """Return the prognosis at a share of the unit's life, from the diagnoses up to that time."""
    return prognose(observed(unit, max(share * unit.failure, 41.0)), ACTUATOR, Question(HORIZON), seed=seed)


def last_slope(unit: Truth, share: float) -> float:
    """Return the RUL [h] according to a straight line through the last ten diagnoses of friction."""
    evidence = observed(unit, max(share * unit.failure, 41.0))
    last = evidence.observations[-10:]
    if len(last) < 2:
        return LONGEST
    slope, offset = np.polyfit([x.hours for x in last], [x.level[0] for x in last], 1)
    if slope <= 0:
        return LONGEST
    return float(np.clip((LIMIT - offset) / slope - evidence.hours, 0, LONGEST))


def main() -> None:
    """Print the metrics of the forecasts at each share of life, and those of the last slope."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--units", type=int, default=30)
    parser.add_argument("--known", action="store_true", help="only the laws that the filter knows")
    parser.add_argument("--seeds", type=int, default=0, help="repeat each unit's prognosis with these many")
    arguments = parser.parse_args()
    laws = KNOWN if arguments.known else KNOWN + UNKNOWN
    units = [truth(i, laws[i % len(laws)]) for i in range(arguments.units)]
    if arguments.seeds:
        for unit in units:
            medians = [
                [min(prediction(unit, share, seed).median, LONGEST) for seed in range(arguments.seeds)]
                for share in SHARES
            ]
            scatter = ", ".join(f"{100 * np.std(np.log(row)):.0f} %" for row in medians)
            print(f"{unit.law}: median RUL over seeds scatters by {scatter} at {SHARES} of life")
        return
    for share in SHARES:
        transforms, scores, good, late, slope_good, slope_scores, fails, probabilities = (
            [] for _ in range(8)
        )
        for unit in units:
            prognosis = prediction(unit, share)
            hours = prognosis.evidence.hours
            true = unit.failure - hours
            sample = Prediction(hours, prognosis.sample)
            transforms.append(probability_integral_transform(sample, true))
            scores.append(crps(prognosis.sample, true, longest=LONGEST))
            good.append(alpha_lambda([sample], unit.failure, 0.0))
            late.append((sample, true))
            line = Prediction(hours, np.array([last_slope(unit, share)]))
            slope_good.append(alpha_lambda([line], unit.failure, 0.0))
            slope_scores.append(crps(line.sample, true, longest=LONGEST))
            probabilities.append(prognosis.probability_of_failure)
            fails.append(true <= HORIZON)
        print(
            f"λ = {share}: {len(units)} units; alpha-lambda {np.mean(good):.2f} (last slope "
            f"{np.mean(slope_good):.2f}); coverage of 90 % {coverage(transforms):.2f}; CRPS "
            f"{np.mean(scores):.0f} h (last slope {np.mean(slope_scores):.0f} h); late by more than 20 % "
            f"{late_prediction_rate(late, 0.2):.2f}; Brier within {HORIZON:g} h "
            f"{brier(probabilities, fails):.3f}"
        )
        worst = sorted(zip(transforms, (unit.law for unit in units), strict=True))
        print("  transforms:", " ".join(f"{value:.2f}{law[0]}" for value, law in worst))


if __name__ == "__main__":
    main()
