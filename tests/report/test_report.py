"""The report: complete, self-contained, and consistent with its diagnosis."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest

import emaphm.report.write
from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.diagnosis import Diagnosis, error_percent
from emaphm.errors import OutputError
from emaphm.estimation import COST_FUNCTIONS
from emaphm.estimation.posterior.mcmc_diagnostics import McmcDiagnostics
from emaphm.estimation.posterior.samples import Posterior
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.plotting.posterior import draw_posterior
from emaphm.report import write_report
from emaphm.report.wording import FITNESS_UNITS

from .conftest import LACKING

HOSTILE = """<script src="http://bad.example/x.js">alert(1)</script>"><img src='//bad.example/i.png'>&amp;"""


class Page(HTMLParser):
    """Parsed page: open tags, addresses, and the text with single blanks."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.source = path.read_text(encoding="utf-8")
        self.tags: list[str] = []
        self.open: list[str] = []
        self.addresses: list[str] = []
        self._text: list[str] = []
        self.feed(self.source)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Store a tag as open, unless it is a void element, and the addresses in it."""
        self.tags.append(tag)
        if tag not in ("meta", "img"):
            self.open.append(tag)
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href", "srcset", "data")]

    def handle_endtag(self, tag: str) -> None:
        """Check that a tag closes the last opened tag."""
        assert self.open.pop() == tag, f"</{tag}> closes something else"

    def handle_data(self, data: str) -> None:
        """Store text."""
        if self.open[-1:] != ["style"]:
            self._text.append(data)

    @property
    def text(self) -> str:
        """All text with single blanks."""
        return " ".join("".join(self._text).split())


@pytest.fixture(scope="module")
def drawn(faulty: Diagnosis, truth: Faults, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a report with its figures, made once because drawing takes long."""
    path = tmp_path_factory.mktemp("drawn") / "report.html"
    write_report(faulty, path, truth=truth)
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "report.html"


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the figures empty for tests that check only the text."""
    for part in ("faults", "fit", "residual", "posterior"):
        monkeypatch.setattr(emaphm.report.write, f"draw_{part}", lambda *_: None)
    monkeypatch.setattr(emaphm.report.write, "svg", lambda _: b"<svg/>")


def test_the_file_is_well_formed_and_self_contained(drawn: Path) -> None:
    page = Page(drawn)
    assert not page.open
    assert "script" not in page.tags
    assert "link" not in page.tags
    assert len(page.addresses) == 3
    for address in page.addresses:
        kind, encoded = address.split(",", 1)
        assert kind == "data:image/svg+xml;base64"
        picture = base64.b64decode(encoded, validate=True)
        assert ET.fromstring(picture).tag.endswith("svg")  # noqa: S314 - made by this test
    style = page.source[page.source.index("<style>") : page.source.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style
    assert [file.name for file in drawn.parent.iterdir()] == [drawn.name]


def test_a_report_is_small_enough_for_mail(drawn: Path) -> None:
    assert drawn.stat().st_size < 1_000_000


@pytest.mark.usefixtures("undrawn")
def test_all_components_have_value_interval_and_meaning(faulty: Diagnosis, path: Path) -> None:
    write_report(faulty, path)
    text = Page(path).text
    for name in NAMES:
        assert name in text
    for expected in (
        "0.3111",
        "0.2811 to 0.3411",
        "dry friction × 1.500",
        "backlash 0.019 rad at the motor",
        "59.0 % of phase b's turns healthy",
        "towards +172.8 deg",
        "position gain × 1.1000",
    ):
        assert expected in text
    assert "None: this recording decides on all eight components." in text


@pytest.mark.usefixtures("undrawn")
def test_the_headline_names_degraded_and_healthy_components(faulty: Diagnosis, path: Path) -> None:
    write_report(faulty, path)
    text = Page(path).text
    assert "Degraded: friction, backlash, phase b winding, rotor eccentricity, position gain." in text
    assert "Size of the faults: dry friction × 1.500, backlash 0.019" in text
    assert "Healthy: phase a winding, phase c winding." in text
    assert text.count("Model explains the recording: yes") == 2  # the verdict and a heading
    assert f"Residual of the averaged model: {faulty.residual_rms_A:.3g} A rms" in text


@pytest.mark.usefixtures("undrawn")
def test_inconclusive_components_have_a_reason_and_units_follow_the_actuator(
    linear: Diagnosis, path: Path
) -> None:
    write_report(linear, path)
    text = Page(path).text
    assert "No fault found, but some components are inconclusive." in text
    assert "Inconclusive: phase a winding, phase b winding, phase c winding, rotor eccentricity." in text
    assert f"rotor eccentricity, eccentricity direction: {LACKING}." in text
    assert f"rotor eccentricity eccentricity – – cannot tell {LACKING}" in text
    assert "0.0059 m at the motor" in text
    assert " rad " not in text
    assert "bias of the averaged model was not measured" in text


@pytest.mark.usefixtures("undrawn")
def test_a_diagnosis_by_an_estimator_states_the_source_of_its_intervals(
    sampled: Diagnosis, path: Path
) -> None:
    assert sampled.posterior is not None
    posterior = replace(sampled.posterior, diagnostics=None)
    write_report(replace(sampled, method="estimator", posterior=posterior), path)
    text = Page(path).text
    assert "It is what the estimator's network states" in text
    assert "bias of the averaged model" not in text
    assert f"Reference runs {sampled.reference_runs}, and those that the estimator has learned from" in text
    assert "None: this recording" in text
    assert "Posterior None" not in text


@pytest.mark.usefixtures("undrawn")
def test_a_degraded_component_of_unknown_size_has_no_printed_size(faulty: Diagnosis, path: Path) -> None:
    reason = "its size may be anywhere in the interval"
    unknown = replace(faulty.components["friction"], interval95=(0.2, 0.8), identifiable=False, reason=reason)
    write_report(replace(faulty, components=dict(faulty.components) | {"friction": unknown}), path)
    text = Page(path).text
    assert "Degraded: friction, backlash" in text
    assert "dry friction × 1." not in text
    assert "that of friction is not identifiable" in text
    assert f"friction – 0.2000 to 0.8000 degraded {reason}" in text
    assert "None: this recording decides on all eight components." in text


@pytest.mark.usefixtures("undrawn")
def test_a_warning_of_a_poor_fit_comes_first(faulty: Diagnosis, path: Path) -> None:
    write_report(replace(faulty, explained=False), path)
    text = Page(path).text
    warning = text.index("Not reliable: the model does not explain this recording.")
    assert warning < text.index("Do not rely on the values") < text.index("Size of the faults")
    assert "Model explains the recording: yes" not in text
    assert "Degraded:" not in text


@pytest.mark.usefixtures("undrawn")
def test_the_truth_is_printed_next_to_the_estimate(faulty: Diagnosis, truth: Faults, path: Path) -> None:
    write_report(faulty, path, truth=truth)
    text = Page(path).text
    error = float(error_percent(truth.vector, faulty.faults.vector))
    assert f"Error of the diagnosis: {error:.2f} %" in text
    assert "0.2500 0.2300 to 0.2700 0.2600 degraded" in text
    write_report(faulty, path, force=True)
    assert "True value" not in Page(path).text
    assert "Error of the diagnosis" not in Page(path).text


@pytest.mark.usefixtures("undrawn")
def test_the_report_states_the_method_and_settings(faulty: Diagnosis, path: Path) -> None:
    write_report(faulty, path)
    text = Page(path).text
    assert text.startswith("Diagnosis of run 3.csv ")  # the path is too long for a heading
    for expected in (
        "rig/run 3.csv: 500 rows at 1000 Hz, 0.5 s",
        "Method hybrid",
        "0.01234 A² (least_squares)",
        "Simulations 940",
        "Reference runs 4",
        "1.25 s",
        "Seed 17",
        "emaphm 9.8.7",
        "position_gain = 100000.0 # 1/s",
    ):
        assert expected in text


def test_all_fitness_functions_have_a_unit() -> None:
    assert FITNESS_UNITS.keys() == COST_FUNCTIONS.keys()


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("field", ["recording", "actuator"])
def test_a_name_with_markup_is_printed_as_text(faulty: Diagnosis, path: Path, field: str) -> None:
    actuator = faulty.actuator.model_copy(update={"name": HOSTILE})
    hostile = (
        replace(faulty, recording=HOSTILE) if field == "recording" else replace(faulty, actuator=actuator)
    )
    write_report(hostile, path)
    page = Page(path)
    assert HOSTILE in page.text
    assert "script" not in page.tags
    assert page.tags.count("img") == 3
    assert not [address for address in page.addresses if not address.startswith("data:")]


@pytest.mark.usefixtures("undrawn")
def test_a_name_that_is_not_valid_text_is_printed(faulty: Diagnosis, path: Path) -> None:
    write_report(replace(faulty, recording="rec\udcff.csv"), path)
    assert "rec?.csv" in Page(path).text


def test_the_same_diagnosis_gives_the_same_bytes_whatever_the_user_s_style(
    faulty: Diagnosis, truth: Faults, drawn: Path, path: Path
) -> None:
    with mpl.rc_context({"figure.facecolor": "black", "font.size": 20, "svg.fonttype": "none"}):
        write_report(faulty, path, truth=truth)
    assert path.read_bytes() == drawn.read_bytes()


@pytest.mark.usefixtures("undrawn")
def test_no_file_is_overwritten_without_force(faulty: Diagnosis, path: Path) -> None:
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="exists already"):
        write_report(faulty, path)
    assert path.read_text(encoding="utf-8") == "mine"
    write_report(faulty, path, force=True)
    assert Page(path).text


@pytest.mark.parametrize("name", ["report.pdf", "report", "missing/report.html"])
def test_an_impossible_output_path_is_refused_by_name(faulty: Diagnosis, tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match=re.escape(str(tmp_path / name))):
        write_report(faulty, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("undrawn")
def test_an_error_leaves_the_earlier_file(
    faulty: Diagnosis, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> int:
        path.parent.joinpath("begun").touch()
        raise OSError(28, "No space left on device")

    path.write_text("before", encoding="utf-8")
    monkeypatch.setattr(Path, "write_text", fails)
    with pytest.raises(OutputError, match="No space left"):
        write_report(faulty, path, force=True)
    assert sorted(file.name for file in path.parent.iterdir()) == ["begun", path.name]
    assert path.read_bytes() == b"before"


def test_an_error_while_drawing_leaves_no_file(
    faulty: Diagnosis, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr(emaphm.report.write, "draw_fit", fails)
    with pytest.raises(RuntimeError):
        write_report(faulty, path)
    assert not list(path.parent.iterdir())


@pytest.mark.usefixtures("undrawn")
def test_an_actuator_of_any_description_can_be_reported(faulty: Diagnosis, path: Path) -> None:
    bare = Actuator.thesis().model_copy(update={"electrical": None, "name": "bare"})
    write_report(replace(faulty, actuator=bare), path)
    assert "[electrical]" not in Page(path).text


@pytest.fixture
def sampled(faulty: Diagnosis) -> Diagnosis:
    """Return the faulty diagnosis with a posterior that agrees, except for phase a and the direction."""
    rng = np.random.default_rng(0)
    components = faulty.components.values()
    faults = np.stack([rng.normal(e.value, e.standard_error, 4000) for e in components], axis=1)
    faults[:, 2] = np.abs(rng.normal(0.0, 0.02, 4000))
    faults[:, 6] = rng.normal(0.98, 0.2, 4000) % 1
    space = ParameterSpace.of(faulty.actuator)
    diagnostics = McmcDiagnostics.of(rng.normal(size=(1000, 32, 8)), 0.25, 1250)
    points = space.points(np.clip(faults, 0, 1))
    return replace(faulty, posterior=Posterior.of(space, points, diagnostics))


@pytest.mark.usefixtures("undrawn")
def test_the_posterior_is_printed_next_to_the_estimates(sampled: Diagnosis, path: Path) -> None:
    write_report(sampled, path)
    page = Page(path)
    assert not page.open
    assert page.tags.count("img") == 4
    assert sampled.posterior
    low, high = sampled.posterior.interval95["short_a"]
    assert f"0.0010 0.0000 to 0.0050 {low:.4f} to {high:.4f} healthy" in page.text
    assert f"short_a: credible interval {low:.4f} to {high:.4f}" in page.text
    assert "friction: 0" not in page.text  # no sentence if both agree
    assert "R-hat" in page.text
    assert "eccentricity at all" not in page.text  # the probability is 1 here


def test_marginals_include_all_probability_and_the_intervals(sampled: Diagnosis) -> None:
    figure = draw_posterior(sampled)
    assert sampled.posterior
    assert [axis.get_title(loc="left") for axis in figure.axes] == list(NAMES)
    for axis, name in zip(figure.axes, NAMES, strict=True):
        heights, edges, _ = axis.patches[0].get_data()  # type: ignore[attr-defined]
        # The axis covers 1.5 of the widest interval: at least 95 %, and no more than all.
        assert 0.95 <= np.sum(heights * np.diff(edges)) <= 1 + 1e-9
        drawn = axis.get_lines()[-1].get_xdata()
        np.testing.assert_array_equal(drawn, sampled.posterior.interval95[name])


def test_the_axes_of_fixed_components_are_empty(sampled: Diagnosis, linear: Diagnosis) -> None:
    space = ParameterSpace.of(linear.actuator)
    assert sampled.posterior
    points = np.random.default_rng(0).random((100, space.dimensions))
    posterior = Posterior.of(space, points, sampled.posterior.diagnostics)
    figure = draw_posterior(replace(linear, posterior=posterior))
    empty = [axis.get_title(loc="left") for axis in figure.axes if axis.texts]
    assert empty == [name for name in NAMES if name in space.fixed]
