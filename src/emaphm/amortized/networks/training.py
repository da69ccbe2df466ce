"""Training of an estimator's network: the network with the least validation loss, from a training set."""

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from emaphm.amortized.networks.network import Network
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.networks.torch_network import converted, library, loss, torch_module
from emaphm.amortized.simulating import TrainingSet
from emaphm.arrays import Array, Single
from emaphm.errors import MethodError
from emaphm.random_streams import child_seed, stream


@dataclass(frozen=True)
class TrainingSettings:
    """Sizes of a network and settings of its training.

    The network has `principal` input components, blocks of `width`, `depth` blocks, and a mixture of
    `components`. It is trained by AdamW (Loshchilov and Hutter 2019) with batches of `batch`, a `rate` that
    rises over `warm_up` steps and falls along a cosine over `epochs`, weight `decay`, and gradients clipped
    at `longest_gradient`. The noise is multiplied by a uniform factor within `noise_factor`, drawn anew for
    each draw and epoch. Training ends after `patience` epochs without a smaller validation loss. After a
    divergence, it continues from the best state at half the rate, at most `restarts` times. The number of
    epochs is reduced to at most `most_steps` batches. Blocks are trained in `half_precision` if the processor
    is faster with it. The effects of larger settings are in docs/estimator_development.md.
    """

    principal: int = 512
    width: int = 640
    depth: int = 3
    components: int = 3
    batch: int = 256
    rate: float = 1e-3
    warm_up: int = 200
    epochs: int = 40
    most_steps: int | None = 12_288
    decay: float = 1e-2
    longest_gradient: float = 5.0
    noise_factor: tuple[float, float] = (0.0, 1.5)
    patience: int = 8
    restarts: int = 2
    half_precision: bool = True

    def of_draws(self, count: int) -> "TrainingSettings":
        """Return the settings with the number of epochs for a training set of `count` draws."""
        if self.most_steps is None:
            return self
        return replace(self, epochs=min(self.epochs, max(1, self.most_steps // max(1, count // self.batch))))


TRAINING = TrainingSettings()

OF_FEATURES = TrainingSettings(principal=1024, noise_factor=(0.0, 0.0), patience=4, half_precision=False)
"""Settings of a network that reads all its features; noise is not added, because the features have it."""

UPDATE_TRAINING = replace(OF_FEATURES, width=256, depth=2, epochs=20, decay=0.1)
"""Settings of the second network."""

PREDICTOR_TRAINING = replace(OF_FEATURES, width=64, depth=1, components=1, epochs=16)
"""Settings of the error predictor."""

DIVERGED = 50.0
"""Rise of the validation loss above its least value that counts as divergence: no training recovers then."""


@dataclass(frozen=True)
class Epoch:
    """Report of an epoch.

    `number` of the epoch, `of` all epochs. Losses are negative log densities. The error is `median_error` [%]
    of the validation set. `note` reports a divergence.
    """

    number: int
    of: int
    training_loss: float
    validation_loss: float
    validation_error: float
    seconds: float
    note: str = ""

    def __str__(self) -> str:
        """Return the report in one line."""
        text = (
            f"epoch {self.number} of {self.of}: validation error {self.validation_error:.2f} %, loss "
            f"{self.validation_loss:.2f} (training {self.training_loss:.2f}), {self.seconds:.0f} s"
        )
        return f"{text}; {self.note}" if self.note else text


OnEpoch = Callable[[Epoch], None]
ErrorOf = Callable[[Array], float]


@dataclass(frozen=True, eq=False)
class Trained:
    """The network with the least validation loss, and the reports of its training."""

    network: Network
    epochs: tuple[Epoch, ...]
    seconds: float

    @property
    def kept(self) -> Epoch:
        """The epoch with the least validation loss, after which `network` was stored."""
        converging = (epoch for epoch in self.epochs if not epoch.note)
        return min(converging, key=lambda epoch: epoch.validation_loss)

    @property
    def notes(self) -> tuple[str, ...]:
        """The notes of divergences, in order."""
        return tuple(epoch.note for epoch in self.epochs if epoch.note)


def train_network(
    training: TrainingSet,
    validation: TrainingSet,
    noise: Single,
    deviations: Array,
    error_of: ErrorOf,
    *,
    seed: int = 0,
    settings: TrainingSettings = TRAINING,
    on_epoch: OnEpoch | None = None,
) -> Trained:
    """Return the network with the least validation loss, trained on `training`.

    Parameters
    ----------
    training, validation
        Noise-free draws; those of `validation` decide the end of the training.
    noise
        Noise of a block of each channel, rms (channels,).
    deviations
        Prior standard deviation of each coordinate, (d,).
    error_of
        Function of the answers' means (n, d) for the validation set; returns their error [%], which is
        reported.

    Raises
    ------
    MethodError
        PyTorch is not installed, or training diverged in its first epochs.
    """
    torch = library()
    settings = settings.of_draws(len(training))
    began = time.perf_counter()
    torch.manual_seed(child_seed(seed, "initial weights"))
    projection = Projection.of(training.rows, noise, settings.principal)
    module = torch_module(
        projection.deviations.size,
        settings.width,
        settings.depth,
        settings.components,
        deviations.size,
        half_precision=settings.half_precision,
    )
    features = features_of(projection, training.rows)
    points = (training.points / deviations).astype(np.float32)
    noise_factor = noise_of_features(projection, noise)

    def new_run(restarts: int, step: int) -> _Run:
        child = child_seed(seed, "training")
        return _Run(torch, module, features, points, noise_factor, settings, child, restarts, step)

    run = new_run(0, 0)
    held_out = features_of(projection, with_noise(validation, noise, stream(seed, "validation noise")))
    epochs: list[Epoch] = []
    best = _BestState(module, settings)
    for number in range(1, settings.epochs + 1):
        training_loss = run.epoch(number)
        validation_loss, means = _validated(torch, module, held_out, validation, deviations, settings)
        note = best.judge(training_loss, validation_loss)
        if note:
            run = new_run(best.restarts, run.step)
        seconds = time.perf_counter() - began
        epochs.append(
            Epoch(number, settings.epochs, training_loss, validation_loss, error_of(means), seconds, note)
        )
        if on_epoch:
            on_epoch(epochs[-1])
        if best.has_ended:
            break
    if not math.isfinite(best.loss):
        raise MethodError(
            "training diverged in its first epochs; give more --simulations, or check the actuator's "
            "description by its simulations"
        )
    module.load_state_dict(best.weights)
    network = converted(module, projection, deviations, settings.components)
    return Trained(network, tuple(epochs), time.perf_counter() - began)


class _BestState:
    """The weights of the least validation loss, and how training has gone since."""

    def __init__(self, module: Any, settings: TrainingSettings) -> None:
        self.module, self.settings = module, settings
        self.weights, self.loss = copy.deepcopy(module.state_dict()), math.inf
        self.since, self.restarts = 0, 0

    def judge(self, training_loss: float, validation_loss: float) -> str:
        """Keep weights that are the best so far; where training diverged, go back to these, with a note."""
        if not math.isfinite(validation_loss + training_loss) or validation_loss > self.loss + DIVERGED:
            self.restarts += 1
            self.module.load_state_dict(self.weights)
            if self.restarts > self.settings.restarts:
                return "training diverged again and ends here; the best state is kept"
            return f"training diverged; it goes on from the best state at a rate of 1/{2**self.restarts}"
        if validation_loss < self.loss:
            self.weights, self.loss = copy.deepcopy(self.module.state_dict()), validation_loss
            self.since = 0
        else:
            self.since += 1
        return ""

    @property
    def has_ended(self) -> bool:
        """Whether the loss no longer falls, or training has diverged too often."""
        return self.since >= self.settings.patience or self.restarts > self.settings.restarts


class _Run:
    """The state of a training run: the optimiser and the number of its steps."""

    def __init__(
        self,
        torch: Any,
        module: Any,
        features: Single,
        points: Single,
        noise_factor: Single,
        settings: TrainingSettings,
        seed: int,
        restarts: int,
        step: int,
    ) -> None:
        self.torch, self.module, self.settings = torch, module, settings
        self.features, self.points, self.noise_factor = map(
            torch.from_numpy, (features, points, noise_factor)
        )
        self.seed, self.restarts, self.step = seed, restarts, step
        self.per_epoch = max(1, len(features) // settings.batch)
        self.optimizer = torch.optim.AdamW(
            module.parameters(), lr=settings.rate, weight_decay=settings.decay, betas=(0.9, 0.98), fused=True
        )

    def epoch(self, number: int) -> float:
        """Train with each draw once; return the mean loss, nan if it diverged."""
        torch, settings = self.torch, self.settings
        generator = torch.Generator().manual_seed(child_seed(self.seed, "epoch", number))
        order = torch.randperm(len(self.features), generator=generator)
        self.module.train()
        total = 0.0
        for batch in range(self.per_epoch):
            draws = order[batch * settings.batch : (batch + 1) * settings.batch]
            self._set_rate()
            outputs = self.module(self._with_noise(self.features[draws], generator))
            value = loss(outputs, self.points[draws], settings.components).mean()
            self.optimizer.zero_grad()
            value.backward()
            torch.nn.utils.clip_grad_norm_(self.module.parameters(), settings.longest_gradient)
            self.optimizer.step()
            self.step += 1
            total += float(value.detach())
            if not math.isfinite(total):
                return math.nan
        return total / self.per_epoch

    def _with_noise(self, features: Any, generator: Any) -> Any:
        """Return features (n, k) with independent noise for each recording."""
        low, high = self.settings.noise_factor
        if high == 0:
            return features
        factor = low + (high - low) * self.torch.rand(len(features), 1, generator=generator)
        normal = self.torch.randn(features.shape, generator=generator)
        return features + factor * (normal @ self.noise_factor)

    def _set_rate(self) -> None:
        done = self.step / (self.per_epoch * self.settings.epochs)
        rising = min(1.0, (self.step + 1) / self.settings.warm_up)
        rate = self.settings.rate * rising * 0.5 * (1 + math.cos(math.pi * min(done, 1.0)))
        for group in self.optimizer.param_groups:
            group["lr"] = rate / 2**self.restarts


AT_ONCE = 4096
"""Draws that are projected, or get noise, together: a copy of all would not fit into memory."""


def with_noise(held_out: TrainingSet, noise: Single, rng: np.random.Generator) -> Single:
    """Return the rows of a set plus the sensors' noise, of rms `noise` (channels,)."""
    rows = np.empty_like(held_out.rows)
    for i in range(0, len(rows), AT_ONCE):
        part = held_out.rows[i : i + AT_ONCE]
        rows[i : i + AT_ONCE] = rng.standard_normal(part.shape, dtype=np.float32)
        rows[i : i + AT_ONCE] *= noise[:, np.newaxis]
        rows[i : i + AT_ONCE] += part
    return rows


def features_of(projection: Projection, rows: Single) -> Single:
    """Return the features (n, k) of rows (n, channels, blocks)."""
    return np.concatenate([projection.features(rows[i : i + AT_ONCE]) for i in range(0, len(rows), AT_ONCE)])


def noise_of_features(projection: Projection, noise: Single) -> Single:
    """Return the factor S (k, k) of the features' noise: it is n S with n (k,) standard normal.

    With noise of rms σ in the rows of a channel, in its unit, and W the directions divided by the components'
    standard deviations: S² = Wᵀ diag(σ²) W, S symmetric.
    """
    relative = np.repeat(noise / projection.units, projection.mean.size // noise.size)
    weight = projection.basis / projection.deviations * relative[:, np.newaxis]
    variances, directions = np.linalg.eigh((weight.T @ weight).astype(float))
    root = directions * np.sqrt(np.maximum(variances, 0.0)) @ directions.T
    return np.asarray(root.astype(np.float32))


def _validated(
    torch: Any,
    module: Any,
    features: Single,
    validation: TrainingSet,
    deviations: Array,
    settings: TrainingSettings,
) -> tuple[float, Array]:
    """Return the mean validation loss, and the means (n, d) of the answers."""
    module.eval()
    with torch.no_grad():
        outputs = module(torch.from_numpy(features))
        points = torch.from_numpy((validation.points / deviations).astype(np.float32))
        value = float(loss(outputs, points, settings.components).mean())
        by_component = outputs.reshape(len(features), settings.components, -1)
        weights = torch.softmax(by_component[..., 0], dim=1)
        means = (weights[..., None] * by_component[..., 1 : 1 + deviations.size]).sum(1).numpy()
    return value, means * deviations


def median_error(means: Array, truths: Array, faults: int) -> float:
    """Return the median error [%]: the root of the sum of squares over the first `faults` coordinates."""
    return 100 * float(np.median(np.sqrt(np.sum((means - truths)[:, :faults] ** 2, axis=1))))
