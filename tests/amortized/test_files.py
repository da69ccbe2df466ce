"""An estimator's file: a written file is read, any other file is refused."""

import io
import json
import pickle
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from amortized.toys import CHIRP, constant_estimator, short_setup
from emaphm.amortized import Estimator
from emaphm.amortized.storage.estimator_file import HEADER
from emaphm.errors import MethodError, OutputError
from emaphm.simulation import AVERAGED

ANSWER = np.linspace(-0.2, 0.6, 10)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("estimator") / "unit.estimator"
    constant_estimator(short_setup(), ANSWER).save(path)
    return path


def test_what_is_read_answers_as_what_was_written(written: Path) -> None:
    before, after = constant_estimator(short_setup(), ANSWER), Estimator.load(written)
    rows = np.random.default_rng(0).normal(size=(3, 2, 200)).astype(np.float32)
    inputs = before.setup.inputs(CHIRP, AVERAGED.step_for(before.setup.actuator))
    for one, other in zip(before.answers(rows, inputs), after.answers(rows, inputs), strict=True):
        np.testing.assert_allclose(one.mean, other.mean)
        np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-3)
    np.testing.assert_array_equal(before.distances(rows), after.distances(rows))
    assert after.actuator_hash == before.actuator_hash
    np.testing.assert_array_equal(after.setup.command_rad, before.setup.command_rad)


def changed(source: Path, target: Path, change: Callable[[dict[str, bytes]], None]) -> Path:
    with zipfile.ZipFile(source) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    change(members)
    with zipfile.ZipFile(target, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return target


def array(values: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, values, allow_pickle=True)
    return buffer.getvalue()


def header(**values: object) -> Callable[[dict[str, bytes]], None]:
    def change(members: dict[str, bytes]) -> None:
        members[HEADER] = json.dumps(json.loads(members[HEADER]) | values).encode()

    return change


def network(**values: object) -> Callable[[dict[str, bytes]], None]:
    def change(members: dict[str, bytes]) -> None:
        content = json.loads(members[HEADER])
        content["network"] |= values
        members[HEADER] = json.dumps(content).encode()

    return change


def setup(**values: object) -> Callable[[dict[str, bytes]], None]:
    def change(members: dict[str, bytes]) -> None:
        content = json.loads(members[HEADER])
        content["setup"] |= values
        members[HEADER] = json.dumps(content).encode()

    return change


def replaced(name: str, content: bytes) -> Callable[[dict[str, bytes]], None]:
    return lambda members: members.__setitem__(name, content)


def zeroed(name: str) -> Callable[[dict[str, bytes]], None]:
    def change(members: dict[str, bytes]) -> None:
        values = np.load(io.BytesIO(members[f"{name}.npy"]))
        members[f"{name}.npy"] = array(np.zeros_like(values))

    return change


class Harm:
    """What prints when it is unpickled."""

    def __reduce__(self) -> tuple[object, ...]:
        return print, ("executed",)


WRONG = {
    "a newer version": (header(format="emaphm estimator 19"), "reads 'emaphm estimator 4'; update emaphm"),
    "the version before": (header(format="emaphm estimator 3"), "'emaphm estimator 4'; train it again"),
    "no version": (header(format="emaphm estimator x"), "'emaphm estimator 4'; train it again"),
    "something else": (header(format="model"), "no estimator"),
    "no header": (lambda members: members.pop(HEADER), "no header.json"),
    "broken header": (replaced(HEADER, b"{"), "no JSON"),
    "another graph": (network(depth=2), "'network.norm1.weight' is missing"),
    "a wider network": (network(width=5), "another shape"),
    "a huge network": (network(width=10**9), "network.width"),
    "other coordinates": (header(coordinates=["friction"] * 10), "coordinates"),
    "a member too many": (replaced("run.py", b"print(1)"), "'run.py'"),
    "no unit": (zeroed("network.units"), "not above 0"),
    "no scatter": (zeroed("update.scatter"), "not above 0"),
    "no number": (replaced("network.entry.bias.npy", array(np.full(4, np.nan, "<f2"))), "not finite"),
    "numbers of another kind": (
        replaced("network.entry.bias.npy", array(np.zeros(4))),
        "another shape or kind",
    ),
    "an object": (replaced("network.entry.bias.npy", array(np.array([Harm()] * 4, object))), "no estimator"),
    "a pickle": (replaced("network.entry.bias.npy", pickle.dumps(Harm())), "no estimator"),
    "an array cut off": (replaced("network.entry.bias.npy", array(np.zeros(4, "<f2"))[:-2]), "no estimator"),
    **{
        f"a made-up header {i}": (
            replaced("temperature.npy", b"\x93NUMPY\x01\x00" + len(made).to_bytes(2, "little") + made),
            "another shape or kind",
        )
        for i, made in enumerate(
            (
                b"{'descr':'<f8','fortran_order':False,'shape':(10,",
                b"{'descr':'<f8','fortran_order':False,'shape':(1000000000000,)}",
                b"{[]:1}",
            )
        )
    },
    "channels exchanged": (setup(channels=["voltage_V", "current_A"]), "do not begin with the current"),
    "a channel twice": (setup(channels=["current_A", "current_A"]), "one occurs twice"),
    "an unknown channel": (setup(channels=["current_A", "voltage"]), "unknown channel 'voltage'"),
    "an unknown nuisance": (
        setup(nuisances=["lod"]),
        "unknown nuisance 'lod' (did you mean 'load'?); the file",
    ),
    "no interval": (setup(interval_s=1e-320), "setup.interval_s"),
    "endless noise": (setup(noise=1e308), "setup.noise"),
    "other rows": (setup(sampling="instant"), "sampling differs from"),
    "a negative limit": (replaced("limits.ratios.npy", array(np.array([1.0, -1.0]))), "below 0"),
    "another actuator's laws": (header(setup={}), "setup.actuator"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_file_that_is_not_what_we_write_is_refused(
    written: Path, tmp_path: Path, case: str, capsys: pytest.CaptureFixture[str]
) -> None:
    change, complaint = WRONG[case]
    path = changed(written, tmp_path / "changed.estimator", change)
    with pytest.raises(MethodError, match=re.escape(complaint)) as error:
        Estimator.load(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    assert ("train" in str(error.value)) != (case == "a newer version")
    assert capsys.readouterr().out == ""


def test_a_file_that_is_cut_off_is_refused(written: Path, tmp_path: Path) -> None:
    content = written.read_bytes()
    path = tmp_path / "cut.estimator"
    for end in np.random.default_rng(0).integers(len(content), size=20):
        path.write_bytes(content[:end])
        with pytest.raises(MethodError):
            Estimator.load(path)


def flipped(content: bytes, place: int) -> bytes:
    """Return the content with all bits of one byte changed."""
    return content[:place] + bytes([content[place] ^ 0xFF]) + content[place + 1 :]


def test_a_flipped_byte_in_what_a_member_holds_is_refused(written: Path, tmp_path: Path) -> None:
    content = written.read_bytes()
    path = tmp_path / "flipped.estimator"
    rng = np.random.default_rng(0)
    with zipfile.ZipFile(written) as archive:
        members = archive.infolist()
    for member in members:
        # A local header has 30 bytes, then the name and an extra field, whose lengths are its last numbers.
        lengths = content[member.header_offset + 26 : member.header_offset + 30]
        begin = member.header_offset + 30 + sum(int.from_bytes(lengths[i : i + 2], "little") for i in (0, 2))
        path.write_bytes(flipped(content, begin + int(rng.integers(member.compress_size))))
        with pytest.raises(MethodError):
            Estimator.load(path)


def test_a_flipped_byte_in_a_date_harms_nothing(written: Path, tmp_path: Path) -> None:
    """A zip checks no dates, and we read none."""
    with zipfile.ZipFile(written) as archive:
        date = archive.infolist()[0].header_offset + 12
    path = tmp_path / "dated.estimator"
    path.write_bytes(flipped(written.read_bytes(), date))
    assert Estimator.load(path).space.coordinates == Estimator.load(written).space.coordinates


def test_absent_and_too_large_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MethodError, match="no such file"):
        Estimator.load(tmp_path / "absent.estimator")
    large = tmp_path / "large.estimator"
    with large.open("wb") as file:
        file.truncate(2**30)
    with pytest.raises(MethodError, match="MiB"):
        Estimator.load(large)


def test_another_compression_than_ours_is_refused(written: Path, tmp_path: Path) -> None:
    path = tmp_path / "lzma.estimator"
    with zipfile.ZipFile(written) as ours, zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as theirs:
        for name in ours.namelist():
            theirs.writestr(name, ours.read(name), zipfile.ZIP_STORED if name == HEADER else None)
    with pytest.raises(MethodError, match="compressed by a method"):
        Estimator.load(path)


def test_a_bomb_is_refused_before_it_is_unpacked(written: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(written) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    path = tmp_path / "bomb.estimator"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, bytes(2**27) if name == "network.basis.npy" else content)
    assert path.stat().st_size < 2**20
    with pytest.raises(MethodError, match="larger"):
        Estimator.load(path)


def test_a_folder_is_no_place_for_an_estimator(tmp_path: Path) -> None:
    with pytest.raises(OutputError):
        constant_estimator(short_setup(), ANSWER).save(tmp_path / "absent" / "unit.estimator")
