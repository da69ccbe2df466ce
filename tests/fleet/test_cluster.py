"""A batch on a Dask cluster: as on this machine."""

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from cases import THESIS
from emaphm.fleet import diagnose_all
from emaphm.fleet.synthetic import Chain, FleetFolder, FleetPlan, prognoses, run_chain
from execution.test_dask_cluster import Cluster

from .files import QUICK, written

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="Dask is not installed")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """Return a cluster of one worker."""
    opened = Cluster(tmp_path_factory.mktemp("cluster"))
    opened.add_worker()
    yield opened
    opened.close()


def test_a_batch_has_the_same_results_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    files = written(tmp_path / "days", 3)
    files[1].write_text("broken", encoding="utf-8")
    here = [one.values for one in diagnose_all(files, THESIS, QUICK, workers=1)]
    there = [
        one.values
        for one in diagnose_all(files, THESIS, QUICK, scheduler=cluster.address, folder=tmp_path / "out")
    ]
    assert [one["recording"] for one in there] == list(map(str, files))
    assert there[1] == here[1]
    for i in (0, 2):
        assert there[i]["k"] == here[i]["k"]
    resumed = [one.values for one in diagnose_all(files, THESIS, QUICK, workers=1, folder=tmp_path / "out")]
    assert resumed == there


def test_a_synthetic_fleet_goes_its_whole_way_on_a_cluster(cluster: Cluster, tmp_path: Path) -> None:
    plan = FleetPlan(units=1, flights=1)
    run_chain(Chain(plan, FleetFolder(tmp_path / "there"), scheduler=cluster.address))
    run_chain(Chain(plan, FleetFolder(tmp_path / "here"), workers=1))
    (there,), (here,) = (prognoses(FleetFolder(tmp_path / name)) for name in ("there", "here"))
    assert there == here
