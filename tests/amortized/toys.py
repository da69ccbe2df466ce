"""Small estimators whose answers are known, for tests."""

from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator, Chirp
from emaphm.amortized.content import Limits
from emaphm.amortized.error_prediction.comparison import predictor_feature_count
from emaphm.amortized.error_prediction.predictor import ErrorPredictor
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.model_update import UPDATE, ModelUpdate, Whitening, feature_count
from emaphm.amortized.networks.layers import Block, Dense, Normalisation
from emaphm.amortized.networks.network import Network, output_width
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import block_of
from emaphm.arrays import Array, Single

THESIS = Actuator.thesis()
SHORT = {"duration": 0.1, "sample_rate": 2000.0}
CHIRP = Chirp(stop_hz=40.0, duration=0.1)


def short_setup(actuator: Actuator = THESIS, **others: object) -> RecordingSetup:
    """Return the setup of a manoeuvre that takes 0.1 s."""
    return RecordingSetup.of(actuator, CHIRP, **{**SHORT, **others})  # type: ignore[arg-type]


def half(values: Array | Single) -> Single:
    """Return single-precision numbers that half precision holds too."""
    return np.asarray(values, np.float16).astype(np.float32)


def constant_estimator(
    setup: RecordingSetup, answer: Array, deviation: float = 0.1, limit: float = 1e6, width: int = 4
) -> Estimator:
    """Return an estimator that answers `answer` (d,) whatever it is asked, normal with one `deviation`."""
    d, k = setup.space.dimensions, 3
    rows = len(setup.channels) * (setup.samples // block_of(setup.samples))
    rng = np.random.default_rng(0)
    basis = half(np.linalg.qr(rng.normal(size=(rows, k)))[0])
    projection = Projection(np.ones(len(setup.channels)), np.zeros(rows, np.float32), basis, np.full(k, 1e3))
    out = np.zeros(output_width(1, d), np.float32)
    out[1 : 1 + d] = answer
    triangle = np.zeros((d, d), np.float32)
    triangle[np.diag_indices(d)] = -np.log(deviation)
    out[1 + d :] = triangle[np.tril_indices(d)]

    def dense(inputs: int, outputs: int) -> Dense:
        return Dense(half(rng.normal(size=(inputs, outputs))), half(rng.normal(size=outputs)))

    norm = Normalisation(np.ones(width, np.float32), np.zeros(width, np.float32))
    network = Network(
        projection,
        dense(k, width),
        (Block(norm, dense(width, width), dense(width, width)),),
        norm,
        Dense(np.zeros((width, out.size), np.float32), half(out)),
        np.ones(d),
        1,
    )
    limits = Limits(np.full(2, limit), np.full(len(setup.channels), limit), limit)
    predictor = constant_predictor(setup, 0.5, width)
    return Estimator(
        setup, network, no_update(setup, width), np.ones(d), predictor, limits, {"simulations": 0}
    )


def constant_predictor(setup: RecordingSetup, ratio: float, width: int = 4) -> ErrorPredictor:
    """Return a predictor of an error of `ratio` times the allowed one, whatever it reads."""
    features = predictor_feature_count(len(setup.channels), setup.space.dimensions)
    projection, norm, nothing = _reading(features, width)
    network = Network(
        projection,
        Dense(np.zeros((features, width), np.float32), np.zeros(width, np.float32)),
        (Block(norm, nothing, nothing),),
        norm,
        Dense(np.zeros((width, output_width(1, 1)), np.float32), half(np.array([0.0, np.log(ratio), 0.0]))),
        np.ones(1),
        1,
    )
    return ErrorPredictor(network)


def _reading(features: int, width: int) -> tuple[Projection, Normalisation, Dense]:
    """Return a projection that leaves features as they are, a norm, and a layer of zeros."""
    projection = Projection(
        np.ones(1), np.zeros(features, np.float32), np.eye(features, dtype=np.float32), np.ones(features)
    )
    norm = Normalisation(np.ones(width, np.float32), np.zeros(width, np.float32))
    return projection, norm, Dense(np.zeros((width, width), np.float32), np.zeros(width, np.float32))


def no_update(setup: RecordingSetup, width: int = 4) -> ModelUpdate:
    """Return an update that compares nothing, so that the first answer stays what it is."""
    d, k = setup.space.dimensions, 2
    rows = len(setup.channels) * (setup.samples // block_of(setup.samples))
    zeros = np.zeros((rows, k), np.float32)
    whitening = Whitening(np.ones(len(setup.channels)), np.zeros(rows, np.float32), zeros)
    features = feature_count(k, d)
    projection, norm, nothing = _reading(features, width)
    # Units that are wider than the answer by their floor.
    lower = np.diag(np.full(d, 0.5 * np.log1p(UPDATE.floor**2)))
    out = np.concatenate([np.zeros(1 + d), lower[np.tril_indices(d)]])
    network = Network(
        projection,
        Dense(np.zeros((features, width), np.float32), np.zeros(width, np.float32)),
        (Block(norm, nothing, nothing),),
        norm,
        Dense(np.zeros((width, out.size), np.float32), half(out)),
        np.ones(d),
        1,
    )
    return ModelUpdate(whitening, network)


def with_limit(estimator: Estimator, limit: float) -> Estimator:
    """Return the estimator with every limit at `limit`."""
    limits = estimator.limits
    return replace(
        estimator,
        limits=Limits(np.full_like(limits.distances, limit), np.full_like(limits.ratios, limit), limit),
    )
