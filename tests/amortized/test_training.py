"""Training: on a problem with a known posterior, and from simulations to a file."""

import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from amortized.toys import CHIRP, short_setup
from emaphm.actuator import Faults
from emaphm.amortized import simulating
from emaphm.amortized.judging import Judgement, judged
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.networks.training import Epoch, TrainingSettings, noise_of_features, train_network
from emaphm.amortized.simulating import (
    TrainingSet,
    read_shard,
    simulate_shards,
    training_folder,
)
from emaphm.amortized.train import notes_on_second_network, train_estimator
from emaphm.arrays import Array
from emaphm.errors import ExecutionError, MethodError, OutputError
from emaphm.simulation import AVERAGED

# Imported where it is used: every process of a test run collects this file, and one runs it.
pytestmark = pytest.mark.skipif(find_spec("torch") is None, reason="PyTorch is not installed")


def no_error(means: Array) -> float:  # noqa: ARG001 - reported, and of no interest here
    return 0.0


SMALL = TrainingSettings(principal=8, width=32, depth=1, components=1, batch=64, epochs=6, warm_up=10)


def linear(count: int, rng: np.random.Generator) -> TrainingSet:
    """Return draws of y = A x with x standard normal, whose posterior under noise is known."""
    mixing = np.random.default_rng(99).normal(size=(3, 16))
    points = rng.normal(size=(count, 3)).astype(np.float32)
    return TrainingSet(points, (points @ mixing).reshape(count, 1, 16).astype(np.float32))


def test_the_posterior_of_a_linear_problem_is_learned() -> None:
    noise = np.full(1, 1.5, np.float32)
    settings = TrainingSettings(
        principal=3,
        width=32,
        depth=1,
        components=2,
        batch=64,
        epochs=6,
        warm_up=20,
        rate=3e-3,
        noise_factor=(1.0, 1.0),
        patience=20,
    )
    trained = train_network(
        linear(3000, np.random.default_rng(0)),
        linear(1000, np.random.default_rng(1)),
        noise,
        np.ones(3),
        no_error,
        settings=settings,
    )
    mixing = np.random.default_rng(99).normal(size=(3, 16))
    covariance = np.linalg.inv(np.eye(3) + mixing @ mixing.T / 1.5**2)
    test = linear(400, np.random.default_rng(2))
    rows = test.rows + 1.5 * np.random.default_rng(3).normal(size=test.rows.shape).astype(np.float32)
    answers = trained.network.mixtures(trained.network.features(rows.astype(np.float32)))
    exact = rows.reshape(400, -1) @ mixing.T / 1.5**2 @ covariance
    deviations = np.sqrt(np.diag(covariance))
    means = np.array([one.mean for one in answers])
    assert np.sqrt(np.mean((means - exact) ** 2, axis=0) / deviations**2).max() < 0.25
    stated = np.mean([one.covariance for one in answers], axis=0)
    np.testing.assert_allclose(stated, covariance, atol=0.2 * deviations.max() ** 2)


def test_numpy_and_torch_run_the_same_network() -> None:
    import torch

    from emaphm.amortized.networks.torch_network import converted, torch_module

    rows = linear(300, np.random.default_rng(0)).rows
    projection = Projection.of(rows, np.full(1, 0.1, np.float32), 3)
    torch.manual_seed(0)
    module = torch_module(3, 16, 2, 3, 4).eval()
    for parameter in module.parameters():
        parameter.data = parameter.data.half().float()
    network = converted(module, projection, np.ones(4), 3)
    expected = module(torch.from_numpy(network.features(rows[:9]))).detach().numpy()
    np.testing.assert_allclose(network.outputs(network.features(rows[:9])), expected, rtol=1e-4, atol=1e-4)


def test_the_trained_loss_is_the_density_of_the_mixture() -> None:
    import torch

    from emaphm.amortized.networks.torch_network import loss

    rng = np.random.default_rng(8)
    d, components = 3, 2
    means, weights = rng.normal(size=(components, d)), np.array([0.3, 0.7])
    lower = np.tril(rng.normal(size=(components, d, d)))
    points = rng.normal(size=(5, d))
    outputs = []
    density = np.zeros(5)
    for weight, mean, one in zip(weights, means, lower, strict=True):
        logs = np.diag(one)
        factor = np.tril(one, -1) + np.diag(np.exp(logs))
        density += weight * multivariate_normal(mean, np.linalg.inv(factor.T @ factor)).pdf(points)
        outputs += [np.log(weight), *mean, *one[np.tril_indices(d)]]
    found = loss(torch.tensor([outputs] * 5), torch.tensor(points), components)
    np.testing.assert_allclose(found, -np.log(density), rtol=1e-6)


def test_noise_of_the_features_is_that_of_the_rows() -> None:
    rng = np.random.default_rng(0)
    basis = rng.normal(size=(6, 4)).astype(np.float32)
    projection = Projection(
        np.array([0.5, 2.0]), np.zeros(6, np.float32), basis, np.array([1.0, 3.0, 0.1, 7.0])
    )
    noise = np.array([0.2, 3.0], np.float32)
    root = noise_of_features(projection, noise)
    drawn = rng.normal(size=(200_000, 2, 3)) * noise[:, np.newaxis]
    covariance = np.cov(projection.features(drawn.astype(np.float32)).T)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(root.T @ root / scale, covariance / scale, atol=0.01)


def test_many_draws_are_learned_from_in_fewer_epochs() -> None:
    settings = TrainingSettings(batch=256, epochs=40, most_steps=1000)
    assert [settings.of_draws(count).epochs for count in (100, 2560, 256_000, 2_560_000)] == [40, 40, 1, 1]
    assert settings.of_draws(256 * 100).epochs == 10
    assert replace(settings, most_steps=None).of_draws(256_000).epochs == 40


def test_divergence_is_reported_and_the_best_state_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    from emaphm.amortized.networks import training as module

    whole = module._Run.epoch
    calls: list[int] = []

    def failing(run: Any, number: int) -> float:
        calls.append(number)
        value = whole(run, number)
        if number >= 3:
            run.module.entry.weight.data.fill_(float("nan"))
        return value

    monkeypatch.setattr(module._Run, "epoch", failing)
    reports: list[Epoch] = []
    trained = train_network(
        linear(640, np.random.default_rng(0)),
        linear(200, np.random.default_rng(1)),
        np.full(1, 0.5, np.float32),
        np.ones(3),
        no_error,
        settings=SMALL,
        on_epoch=reports.append,
    )
    assert "diverged" in reports[2].note
    assert trained.notes[-1].endswith("the best state is kept")
    assert all(np.all(np.isfinite(block.first.weight)) for block in trained.network.blocks)
    assert np.all(np.isfinite(trained.network.entry.weight))


def test_training_stops_when_the_validation_loss_no_longer_falls() -> None:
    settings = TrainingSettings(
        principal=3, width=32, depth=1, components=1, batch=32, epochs=60, patience=2, rate=1e-2, warm_up=1
    )
    trained = train_network(
        linear(64, np.random.default_rng(0)),
        linear(400, np.random.default_rng(1)),
        np.full(1, 1.0, np.float32),
        np.ones(3),
        no_error,
        settings=settings,
    )
    assert len(trained.epochs) < 60
    assert trained.kept.validation_loss < trained.epochs[-1].validation_loss
    assert trained.epochs[-1].validation_loss > min(one.validation_loss for one in trained.epochs)


def test_an_estimator_with_large_errors_of_its_means_is_poor() -> None:
    space = short_setup().space
    truths = np.tile(space.points(Faults(friction=0.3, gain=0.6).vector), (64, 1))

    def judgement(off: float) -> Judgement:
        means = truths + off * np.eye(space.dimensions)[0]
        answers = [
            Mixture(np.ones(1), mean[np.newaxis], 0.1 * np.eye(mean.size)[np.newaxis]) for mean in means
        ]
        return judged(answers, truths, space, np.random.default_rng(0))

    assert judgement(0.09).poor is None
    assert str(judgement(0.11).poor).startswith("poor: its answers err by 11 % (median)")


def test_a_second_network_with_a_larger_error_is_noted() -> None:
    first, second = (Epoch(3, 9, 1.0, 2.0, error, 1.0) for error in (53.5, 72.5))
    note = "72.5 % with the second network, 53.5 % with the first alone; give more --simulations"
    assert notes_on_second_network(second, first) == notes_on_second_network(first, first) == []
    assert notes_on_second_network(first, second) == [f"the median error is {note}"]


@pytest.fixture
def small_shards(monkeypatch: pytest.MonkeyPatch) -> None:
    from emaphm.amortized import train
    from emaphm.amortized.stages import answering_networks, error_predictor

    for module in (simulating, train, answering_networks, error_predictor):
        monkeypatch.setattr(module, "SHARD_DRAWS", 64)


@pytest.mark.usefixtures("small_shards")
def test_simulations_continue_after_an_interruption(tmp_path: Path) -> None:
    setup = short_setup()
    folder = training_folder(tmp_path / "work", setup, 0)
    with folder.locked():
        simulate_shards(setup, CHIRP, 2, folder, workers=1)
    first = folder.path / "shard-00000.npz"
    before = first.read_bytes()
    (folder.path / "shard-00001.npz").write_bytes(before[:100])
    done: list[tuple[int, int]] = []
    with folder.locked():
        simulate_shards(setup, CHIRP, 3, folder, workers=1, on_shard=lambda *at: done.append(at))
    assert done == [(1, 3), (2, 3), (3, 3)]
    assert first.read_bytes() == before
    held = read_shard(folder.path / "shard-00001.npz")
    assert held is not None
    assert held[1].shape == (64, 2, 200)


@pytest.mark.usefixtures("small_shards")
def test_a_full_disk_keeps_what_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setup = short_setup()
    folder = training_folder(tmp_path / "work", setup, 0)
    whole = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if (folder.path / "shard-00000.npz").exists():
            raise OSError(28, "No space left on device")
        return whole(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    with folder.locked(), pytest.raises(OutputError, match="No space left"):
        simulate_shards(setup, CHIRP, 2, folder, workers=1)
    assert sorted(path.name for path in folder.path.glob("*.npz")) == ["shard-00000.npz"]


def test_two_trainings_do_not_share_a_folder(tmp_path: Path) -> None:
    folder = training_folder(tmp_path / "work", short_setup(), 0)
    with folder.locked(), pytest.raises(ExecutionError, match="another training"):
        train_estimator(short_setup(), CHIRP, tmp_path / "work", simulations=1024)
    with pytest.raises(ExecutionError, match=r"another setup: 'setup\.channels"):
        training_folder(tmp_path / "work", short_setup(channels=("current_A",)), 0)


def test_shards_of_another_version_are_not_continued(tmp_path: Path) -> None:
    folder = training_folder(tmp_path / "work", short_setup(), 0)
    begun = json.loads(folder.settings.read_text(encoding="utf-8"))
    for there in ({"revision": "0123456789ab"}, {}):
        held = {key: value for key, value in begun.items() if key != "revision"} | there
        folder.settings.write_text(json.dumps(held), encoding="utf-8")
        with pytest.raises(ExecutionError, match=r"another version of emaphm \(.*; give another --folder"):
            training_folder(tmp_path / "work", short_setup(), 0)


def test_too_few_simulations_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MethodError, match="too few"):
        train_estimator(short_setup(), CHIRP, tmp_path / "work", simulations=10)


@pytest.mark.usefixtures("small_shards")
def test_from_simulations_to_a_file(tmp_path: Path) -> None:
    setup = short_setup(nuisances=())
    stages: list[str] = []

    def stage(text: str) -> None:
        stages.append(text)
        again = training_folder(tmp_path / "work", setup, 0)
        with pytest.raises(ExecutionError, match="another training"), again.locked():
            pass

    estimator = train_estimator(
        setup,
        CHIRP,
        tmp_path / "work",
        simulations=128,
        workers=1,
        settings=replace(SMALL, epochs=2),
        on_stage=stage,
    )
    assert sum("network is kept as after epoch" in stage for stage in stages) == 2
    path = tmp_path / "unit.estimator"
    estimator.save(path)
    again = type(estimator).load(path)
    held = read_shard(tmp_path / "work" / "shard-00002.npz")
    assert held is not None
    inputs = setup.inputs(CHIRP, AVERAGED.step_for(setup.actuator))
    one, other = (each.answers(held[1][:1], inputs)[0] for each in (estimator, again))
    np.testing.assert_allclose(one.mean, other.mean, atol=1e-6)
    assert again.facts["simulations"] == 128
    # 128 simulations are too few to learn from, and the file states it.
    assert again.facts["judgement"]["median_error_percent"] > 50
    assert any(note.startswith("poor: ") for note in again.facts["notes"])
    assert set(again.facts["judgement"]["coverage95"]) == set(setup.space.coordinates)
