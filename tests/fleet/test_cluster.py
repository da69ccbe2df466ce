"""Batches and synthetic fleets on a Dask cluster, against the results on this machine."""

import shutil
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from shutil import ignore_patterns

import polars as pl
import pytest

from cases import THESIS
from dask_processes import Cluster, Forks
from emaphm.fleet import diagnose_all
from emaphm.fleet.synthetic import Chain, FleetFolder, FleetPlan, prognoses, run_chain
from emaphm.history import History

from .files import QUICK, written

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="Dask is not installed")


@pytest.fixture(scope="module")
def cluster(forks: Forks, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Return a cluster of one worker."""
    opened = Cluster(forks, tmp_path_factory.mktemp("cluster"))
    opened.add_worker()
    yield opened
    opened.close()


def test_a_batch_gives_the_same_results_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    files = written(tmp_path / "days", 3)
    files[1].write_text("broken", encoding="utf-8")
    here = [result.values for result in diagnose_all(files, THESIS, QUICK, workers=1)]
    there = [
        result.values
        for result in diagnose_all(files, THESIS, QUICK, scheduler=cluster.address, folder=tmp_path / "out")
    ]
    assert [result["recording"] for result in there] == list(map(str, files))
    assert there[1] == here[1]
    for i in (0, 2):
        assert there[i]["k"] == here[i]["k"]
    resumed = [
        result.values for result in diagnose_all(files, THESIS, QUICK, workers=1, folder=tmp_path / "out")
    ]
    assert resumed == there


@pytest.mark.evidence
def test_the_chain_of_a_synthetic_fleet_gives_the_same_results_on_a_cluster(
    cluster: Cluster, tmp_path: Path
) -> None:
    plan = FleetPlan(units=1, flights=1)
    there, here = (FleetFolder(tmp_path / name) for name in ("there", "here"))
    run_chain(Chain(plan, there, scheduler=cluster.address))
    with History.open(there.history) as history:
        (unit,) = history.units()
        (diagnosis,) = unit.diagnoses()
    truth = pl.read_parquet(there.path / "truth" / "levels.parquet").filter(hours=diagnosis.hours)
    assert truth["unit"].to_list() == [unit.serial_number]
    assert diagnosis.explained
    assert diagnosis.vector[0] == pytest.approx(truth["friction"][0], abs=0.02)
    # Repeat only recording and prognosis on this machine; the test above compares diagnoses.
    done = ignore_patterns("recordings", "results.sqlite*", there.prognoses.name)
    shutil.copytree(there.path, here.path, ignore=done)
    run_chain(Chain(plan, here, workers=1))
    assert prognoses(here) == prognoses(there)
    (ours,), (theirs,) = (
        sorted(fleet_folder.path.rglob("flight-*.parquet")) for fleet_folder in (here, there)
    )
    assert ours.read_bytes() == theirs.read_bytes()
