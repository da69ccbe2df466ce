"""Training of an estimator's network: from a training set to the network whose validation loss was least."""

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from emaphm.amortized.networks.network import Network, Single
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.networks.torch_network import converted, library, loss, made
from emaphm.amortized.simulating import TrainingSet
from emaphm.arrays import Array
from emaphm.errors import MethodError
from emaphm.random_streams import child_seed, stream


@dataclass(frozen=True)
class TrainingSettings:
    """The network and how it is trained; docs/fast_estimator.md says what more of it would bring.

    A network of `principal` components, `width`, and `depth` blocks, whose mixture has `components`. AdamW
    (Loshchilov and Hutter 2019) with batches of `batch`, a `rate` that rises over `warm_up` steps and falls
    along a cosine over `epochs`, weight `decay`, and gradients clipped at `longest_gradient`. Noise is
    multiplied by an even factor within `noise_factor`, drawn anew for every draw and epoch. Training ends
    early after `patience` epochs without a smaller validation loss. One that diverges goes on from the best
    state at half the rate, `restarts` times at most.
    """

    principal: int = 512
    width: int = 640
    depth: int = 3
    components: int = 3
    batch: int = 256
    rate: float = 1e-3
    warm_up: int = 200
    epochs: int = 40
    decay: float = 1e-2
    longest_gradient: float = 5.0
    noise_factor: tuple[float, float] = (0.0, 1.5)
    patience: int = 8
    restarts: int = 2


TRAINING = TrainingSettings()

UPDATE_TRAINING = TrainingSettings(
    principal=1024, width=256, depth=2, epochs=12, noise_factor=(0.0, 0.0), patience=4
)
"""Of the second network: it reads all of its features, and they have their noise already."""

DOUBT_TRAINING = TrainingSettings(
    principal=1024, width=64, depth=1, components=1, epochs=16, noise_factor=(0.0, 0.0), patience=4
)
"""Of the network of the doubt."""

DIVERGED = 50.0
"""Rise of the validation loss above its least that counts as divergence: no training recovers from it."""


@dataclass(frozen=True)
class Epoch:
    """What is reported after each epoch.

    Losses are negative log densities. The error is that of the validation set, as `median_error`. `note` says
    what went wrong.
    """

    number: int
    of: int
    training_loss: float
    validation_loss: float
    validation_error: float
    seconds: float
    note: str = ""

    def __str__(self) -> str:
        """Return one line."""
        text = (
            f"epoch {self.number} of {self.of}: validation error {self.validation_error:.2f} %, loss "
            f"{self.validation_loss:.2f} (training {self.training_loss:.2f}), {self.seconds:.0f} s"
        )
        return f"{text}; {self.note}" if self.note else text


OnEpoch = Callable[[Epoch], None]
ErrorOf = Callable[[Array], float]


@dataclass(frozen=True, eq=False)
class Trained:
    """The network of the least validation loss, its projection, and how it came about."""

    network: Network
    projection: Projection
    epochs: tuple[Epoch, ...]
    seconds: float

    @property
    def notes(self) -> tuple[str, ...]:
        """What went wrong on the way, in order."""
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
    """Return the network that learned most from `training`.

    Parameters
    ----------
    training, validation
        Noise-free draws; the second ones decide when to stop.
    noise
        Of a block of each channel, rms (channels,).
    deviations
        Of each coordinate before a recording, (d,).
    error_of
        Returns the error [%] of answers' means (n, d) for the validation set, which is reported.

    Raises
    ------
    MethodError
        PyTorch is not installed, or training diverged before it had learned anything.
    """
    torch = library()
    began = time.perf_counter()
    torch.manual_seed(child_seed(seed, "initial weights"))
    projection = Projection.of(training.rows, noise, settings.principal)
    layer = projection.layer
    module = made(layer, settings.width, settings.depth, settings.components, deviations.size)

    def run_on(restarts: int, step: int) -> _Run:
        child = child_seed(seed, "training")
        return _Run(torch, module, training, noise, deviations, settings, child, restarts, step)

    run = run_on(0, 0)
    held_out = with_noise(validation, noise, stream(seed, "validation noise"))
    epochs: list[Epoch] = []
    best, least, since, restarts = copy.deepcopy(module.state_dict()), math.inf, 0, 0
    number = 0
    while number < settings.epochs:
        number += 1
        training_loss = run.epoch(number)
        validation_loss, means = _validated(torch, module, held_out, validation, deviations, settings)
        note = ""
        if not math.isfinite(validation_loss + training_loss) or validation_loss > least + DIVERGED:
            restarts += 1
            note = f"training diverged; it goes on from the best state at a rate of 1/{2**restarts}"
            if restarts > settings.restarts:
                note = "training diverged again and ends here; the best state is kept"
            module.load_state_dict(best)
            run = run_on(restarts, run.step)
        elif validation_loss < least:
            best, least, since = copy.deepcopy(module.state_dict()), validation_loss, 0
        else:
            since += 1
        seconds = time.perf_counter() - began
        epochs.append(
            Epoch(number, settings.epochs, training_loss, validation_loss, error_of(means), seconds, note)
        )
        if on_epoch:
            on_epoch(epochs[-1])
        if since >= settings.patience or restarts > settings.restarts:
            break
    if not math.isfinite(least):
        raise MethodError(
            "training diverged before anything was learned; give more --simulations, or check the actuator's "
            "description: do its simulations look right?"
        )
    module.load_state_dict(best)
    network = converted(module, layer, deviations, settings.components)
    return Trained(network, projection, tuple(epochs), time.perf_counter() - began)


class _Run:
    """The state of an optimisation: its optimiser and the numbers of its steps."""

    def __init__(
        self,
        torch: Any,
        module: Any,
        training: TrainingSet,
        noise: Single,
        deviations: Array,
        settings: TrainingSettings,
        seed: int,
        restarts: int,
        step: int,
    ) -> None:
        self.torch, self.module, self.training, self.settings = torch, module, training, settings
        self.noise, self.deviations, self.seed = noise, deviations, seed
        self.restarts, self.step = restarts, step
        self.points = torch.from_numpy((training.points / deviations).astype(np.float32))
        self.rows = torch.from_numpy(training.rows)
        self.per_epoch = max(1, len(training) // settings.batch)
        self.optimizer = torch.optim.AdamW(
            module.parameters(), lr=settings.rate, weight_decay=settings.decay, betas=(0.9, 0.98)
        )

    def epoch(self, number: int) -> float:
        """Learn once from every draw; return the mean loss, nan where it diverged."""
        torch, settings = self.torch, self.settings
        generator = torch.Generator().manual_seed(child_seed(self.seed, "epoch", number))
        order = torch.randperm(len(self.training), generator=generator)
        low, high = settings.noise_factor
        noise = torch.from_numpy(self.noise)[:, None]
        self.module.train()
        total = 0.0
        for batch in range(self.per_epoch):
            chosen = order[batch * settings.batch : (batch + 1) * settings.batch]
            rows = self.rows[chosen]
            factor = low + (high - low) * torch.rand(len(chosen), 1, 1, generator=generator)
            rows = rows + factor * noise * torch.randn(rows.shape, generator=generator)
            self._set_rate()
            with torch.autocast("cpu", torch.bfloat16, enabled=has_half_precision(torch)):
                outputs = self.module(rows.flatten(1))
            value = loss(outputs, self.points[chosen], settings.components).mean()
            self.optimizer.zero_grad()
            value.backward()
            torch.nn.utils.clip_grad_norm_(self.module.parameters(), settings.longest_gradient)
            self.optimizer.step()
            self.step += 1
            total += float(value.detach())
            if not math.isfinite(total):
                return math.nan
        return total / self.per_epoch

    def _set_rate(self) -> None:
        done = self.step / (self.per_epoch * self.settings.epochs)
        rising = min(1.0, (self.step + 1) / self.settings.warm_up)
        rate = self.settings.rate * rising * 0.5 * (1 + math.cos(math.pi * min(done, 1.0)))
        for group in self.optimizer.param_groups:
            group["lr"] = rate / 2**self.restarts


def has_half_precision(torch: Any) -> bool:
    """Return whether the processor multiplies matrices of bfloat16 itself, three times as fast."""
    asked = getattr(torch.cpu, "_is_avx512_bf16_supported", None)
    return bool(asked and asked())


def with_noise(held_out: TrainingSet, noise: Single, rng: np.random.Generator) -> Single:
    """Return the rows of a set with the sensors' noise, rms (channels,)."""
    normal = rng.standard_normal(held_out.rows.shape, dtype=np.float32)
    return np.asarray(held_out.rows + noise[:, np.newaxis] * normal)


def _validated(
    torch: Any,
    module: Any,
    rows: Single,
    validation: TrainingSet,
    deviations: Array,
    settings: TrainingSettings,
) -> tuple[float, Array]:
    """Return the mean loss, and the means (n, d) of the answers."""
    module.eval()
    with torch.no_grad():
        outputs = module(torch.from_numpy(rows).flatten(1))
        points = torch.from_numpy((validation.points / deviations).astype(np.float32))
        value = float(loss(outputs, points, settings.components).mean())
        by_component = outputs.reshape(len(rows), settings.components, -1)
        weights = torch.softmax(by_component[..., 0], dim=1)
        means = (weights[..., None] * by_component[..., 1 : 1 + deviations.size]).sum(1).numpy()
    return value, means * deviations


def median_error(means: Array, truths: Array, faults: int) -> float:
    """Return the median of the root of the sum of squares over the first `faults` coordinates [%]."""
    return 100 * float(np.median(np.sqrt(np.sum((means - truths)[:, :faults] ** 2, axis=1))))
