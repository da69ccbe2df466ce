"""Last stage of a training: the limits of the estimator, and its assessment on held-out simulations."""

from typing import Any

import numpy as np

from emaphm.amortized.applicability.likeness import are_beyond, limits_of
from emaphm.amortized.error_prediction.predictor import ErrorPredictor
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.judging import Judgement, judged
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.training import with_noise
from emaphm.amortized.parts import of_parts
from emaphm.amortized.simulating import TrainingSet, noise_rms
from emaphm.amortized.stages.answering import Answering
from emaphm.arrays import Array
from emaphm.random_streams import stream

PART_DRAWS = 512
"""Held-out draws that one core evaluates together."""


def finished(
    answering: Answering,
    predictor: ErrorPredictor,
    validation: TrainingSet,
    judging: TrainingSet,
    seed: int,
    facts: dict[str, Any],
) -> Estimator:
    """Return the estimator with its limits, and with its assessment among its facts."""
    setup, space = answering.setup, answering.setup.space

    def evaluate(draws: TrainingSet, name: str) -> tuple[list[Mixture], Array, Array, Array]:
        """Return the answers, and the statistics with limits: distances, ratios and predicted errors."""
        rows = with_noise(draws, noise_rms(setup), stream(seed, f"noise of the {name}"))

        def of_part(part: slice, number: int) -> tuple[list[Mixture], Array, Array, Array]:
            answers = answering.answers(rows[part])
            features, ratios = answering.compared(rows[part], answers, stream(seed, "likeness", name, number))
            return answers, answering.distances(rows[part]), ratios, predictor.predicted(features)

        parts = list(of_parts(of_part, len(rows), PART_DRAWS))
        answers = [answer for part in parts for answer in part[0]]
        distances, ratios, errors = (np.concatenate([part[i] for part in parts]) for i in (1, 2, 3))
        return answers, distances, ratios, errors

    limits = limits_of(*evaluate(validation, "calibration")[1:])
    answers, *statistics = evaluate(judging, "judgement")
    rng = stream(seed, "samples of the judgement")
    judgement = judged(answers, judging.points.astype(float), space, rng)
    beyond = float(np.mean(are_beyond(limits, *statistics)))
    facts = {
        **facts,
        "notes": [*facts["notes"], *([judgement.poor] if judgement.poor else [])],
        "judgement": _judgement_dict(judgement, space.coordinates) | {"not_believed": beyond},
    }
    first = answering.first
    return Estimator(
        setup,
        first.network,
        answering.update,
        answering.temperature,
        predictor,
        limits,
        facts,
    )


def _judgement_dict(judgement: Judgement, coordinates: tuple[str, ...]) -> dict[str, Any]:
    return {
        "draws": judgement.draws,
        "median_error_percent": judgement.median,
        "p95_error_percent": judgement.p95,
        "coverage95": dict(zip(coordinates, judgement.coverage.tolist(), strict=True)),
        "rank_chi2": dict(zip(coordinates, judgement.rank_statistic.tolist(), strict=True)),
        "rank_chi2_limit": judgement.rank_limit,
        "ranks": dict(zip(coordinates, judgement.ranks.tolist(), strict=True)),
    }
