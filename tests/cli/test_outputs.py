"""Output files: nothing is overwritten unasked or written partly, and refusals come before the work."""

import warnings
from pathlib import Path
from types import SimpleNamespace

import pytest
from matplotlib.figure import Figure

# Loaded before a function is replaced: a module that imports its name later would keep the replacement.
import emaphm.demo  # noqa: F401
from emaphm.cli.output import draw

from .conftest import Emaphm, Refusal

WRITERS = {
    "simulate {}": ("out.csv", "out.parquet"),
    "diagnose good.csv --report {}": ("out.html",),
    "calibrate good.csv --free inertia -o {}": ("out.toml",),
    "calibrate good.csv --free inertia -o spare.toml --figure {}": ("out.png",),
    "replay good.csv --figure {}": ("out.png", "out.svg", "out.pdf"),
}
"""All options that write a file, with their accepted endings."""

MAGIC = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
"""First bytes of a figure's file, by its ending."""

EACH = [(line, name) for line, names in WRITERS.items() for name in names]


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every simulation and identification fail the test."""

    def work(*_: object, **__: object) -> None:
        pytest.fail("the work was done first")

    for name in (
        "simulated_recording.simulate",
        "diagnosis.diagnose",
        "calibration.calibrate",
        "estimation.replay",
    ):
        monkeypatch.setattr(f"emaphm.{name}", work)
    monkeypatch.setattr("emaphm.demo.simulate", work)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(("line", "name"), EACH)
def test_an_existing_file_is_not_overwritten(refused: Refusal, desk: Path, line: str, name: str) -> None:
    # `refused` compares all contents before and after.
    (desk / name).write_text("three weeks of work", encoding="utf-8")
    message = refused(*line.format(name).split())
    for piece in (f"{name}: exists already", "--force"):
        assert piece in message


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("line", WRITERS)
@pytest.mark.parametrize(
    ("where", "pieces"),
    [
        ("absent/{}", ("folder 'absent' does not exist", "create it")),
        ("good.csv/{}", ("folder 'good.csv' is not a folder", "another one")),
        ("folder", ("folder: is a folder", "name of a file in it")),
        ("out.xyz", ("'.xyz'", "end the name in .")),
        ("out", ("no ending", "end the name in .")),
        ("", ("is a folder",)),
    ],
)
def test_an_impossible_output_is_refused_before_the_work(
    refused: Refusal, desk: Path, line: str, where: str, pieces: tuple[str, ...]
) -> None:
    (desk / "folder").mkdir()
    path = where.format(WRITERS[line][0])
    message = refused(*(part.format(path) for part in line.split()))
    for piece in pieces:
        assert piece in message


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("line", WRITERS)
@pytest.mark.parametrize(
    "target",
    [
        "absent/file",
        "itself",
    ],
)
def test_a_broken_link_is_refused_before_the_work(
    refused: Refusal, desk: Path, line: str, target: str
) -> None:
    name = WRITERS[line][0]
    (desk / name).symlink_to(name if target == "itself" else target)
    assert name in refused(*line.format(name).split())


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("line", WRITERS)
def test_a_system_folder_is_refused_before_the_work(refused: Refusal, line: str) -> None:
    if not Path("/proc/self").is_dir():
        pytest.skip("needs a folder that nobody may write to: /proc")
    path = Path("/proc") / WRITERS[line][0]
    assert f"{path}: cannot be written there" in refused(*line.format(path).split())


def _plain_figure() -> Figure:
    figure = Figure()
    figure.subplots().plot(range(9))
    return figure


@pytest.mark.parametrize(("line", "name"), EACH)
def test_force_replaces_the_file_in_the_format_of_its_name_and_leaves_no_other_file(
    emaphm: Emaphm, desk: Path, monkeypatch: pytest.MonkeyPatch, line: str, name: str
) -> None:
    monkeypatch.setattr("emaphm.report.write.svg", lambda _: b"<svg/>")  # `test_verbs.py` draws it
    (desk / name).write_text("old", encoding="utf-8")
    verb = line.partition(" ")[0]
    if name.endswith((".svg", ".pdf")):  # the whole figure is drawn as a PNG
        monkeypatch.setattr("emaphm.plotting.replay.draw_replay", lambda *_: _plain_figure())
    plain = ["--no-correction", "--nuisance", "none"]
    quick = {"simulate": ["--model", "averaged"], "diagnose": plain, "calibrate": plain}.get(verb, [])
    code, _, err = emaphm(*line.format(name).split(), *quick, "--force")
    assert (code, err) == (0, "")
    content = (desk / name).read_bytes()
    assert len(content) > 1000
    assert content.startswith(MAGIC.get(Path(name).suffix, b""))
    spare = {"spare.toml"} if "spare.toml" in line else set()
    assert {path.name for path in desk.iterdir()} == {"good.csv", "good.toml", name} | spare


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("present", ["report.html", "diagnosis.svg"])
def test_the_demo_does_not_overwrite_files(refused: Refusal, desk: Path, present: str) -> None:
    (desk / "demo").mkdir()
    (desk / "demo" / present).write_text("mine", encoding="utf-8")
    assert f"{present}: exists already" in refused("demo")


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("where", ["good.csv", "good.csv/demo"])
def test_the_demo_needs_a_folder(refused: Refusal, where: str) -> None:
    message = refused("demo", "--out", where)
    for piece in (f"{where}: this folder cannot be created", "--out"):
        assert piece in message


@pytest.mark.parametrize("option", ["--noise=-1", "--noise=nan", "--adc-bits=1"])
def test_impossible_sensors_are_refused_before_the_work(
    refused: Refusal, monkeypatch: pytest.MonkeyPatch, option: str
) -> None:
    monkeypatch.setattr("emaphm.simulated_recording.run", lambda *_: pytest.fail("the work was done first"))
    assert refused("simulate", "out.csv", option)


@pytest.mark.parametrize("line", ["simulate --model averaged -o out.csv", "init --from dc -o out.toml"])
def test_the_first_result_file_may_be_named_by_an_option(emaphm: Emaphm, desk: Path, line: str) -> None:
    assert emaphm(*line.split()).code == 0
    assert (desk / line.rsplit(maxsplit=1)[-1]).is_file()


@pytest.mark.parametrize("name", ["out.png", "out.pdf"])
def test_a_character_that_the_font_lacks_causes_no_warning(name: str, tmp_path: Path) -> None:
    figure = _plain_figure()
    figure.suptitle("\u8bb0\u5f55.csv")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        draw(SimpleNamespace(plot=lambda: figure), tmp_path / name)
    assert (tmp_path / name).stat().st_size > 1000
