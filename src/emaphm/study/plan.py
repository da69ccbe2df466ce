"""The plan of a study: methods, cases, rigs and numbers of runs, read from TOML."""

import itertools
import math
import os
import tomllib
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, ValidationError, field_validator, model_validator

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.section import Section
from emaphm.actuator.toml import validation_message
from emaphm.errors import StudyError, nearest
from emaphm.estimation.search import check_fitness
from emaphm.input_files import is_file, read_toml
from emaphm.recording.equivalent_current import Form
from emaphm.simulation import model_named
from emaphm.study.cases import MOST_RUNS, Count, Group, RandomCases
from emaphm.study.contestant import Contestant
from emaphm.study.rig import Label, Manoeuvre, NoiseA, Rig

BUILT_IN = (
    "thesis",
    "quick",
    "hybrids",
    "forms",
    "monitor",
    "accuracy",
    "limits",
    "plants",
    "loads",
    "data_sheets",
    "pmsm",
    "six_step",
)
"""Plans that come with the package."""


class PageRow(Section):
    """A row of a page's table: its `text`, and the rig and method whose results it shows."""

    text: str
    rig: Label
    method: Label


class PageSection(Section):
    """A section of a plan's page: a table of rigs and methods under a title.

    `label` names the condition that varies between rows, `note` explains it, and `figure` is the name of the
    figure of these rows, empty without a figure.
    """

    title: Label
    label: str
    note: str = ""
    figure: str = ""
    rows: tuple[PageRow, ...]


class Plan(Section):
    """A comparison: every case × method × model × fitness × current × noise or rig, `runs` times each.

    Read from TOML by `load`. A case maps fault names to values in [0, 1]; other faults are healthy. If there
    are `groups`, each defines which cases are run on which rigs with which methods, and how often. `page` is
    the page that a report of the study writes from its `sections`; by default, the general report.
    """

    name: Label
    description: str = ""
    page: Literal["accuracy", "limits", "plants", "loads", "data_sheets", "pmsm", "six_step"] | None = None
    runs: Count
    seed: Annotated[int, Field(ge=0)] = 0
    actuator: Actuator = Actuator.thesis()
    manoeuvre: Manoeuvre = Manoeuvre()
    models: tuple[str, ...] = ("averaged",)
    fitnesses: tuple[str, ...] = ("least_squares",)
    equivalents: tuple[Form, ...] = ("torque",)
    noises_A: tuple[NoiseA, ...] = (0.0,)
    cases: dict[Label, dict[str, float]] = Field(default_factory=dict)
    random: RandomCases | None = None
    methods: tuple[Contestant, ...]
    rigs: tuple[Rig, ...] = ()
    groups: tuple[Group, ...] = ()
    sections: tuple[PageSection, ...] = ()

    @field_validator("actuator", mode="before")
    @classmethod
    def _load_actuator(cls, value: Any) -> Any:
        return Actuator.load(value) if isinstance(value, str) else value

    @field_validator("equivalents", mode="before")
    @classmethod
    def _check_equivalents(cls, value: Any) -> Any:
        for form in value if isinstance(value, list | tuple) else ():
            if form not in get_args(Form):
                raise StudyError(f"unknown equivalent current '{form}'{nearest(str(form), get_args(Form))}")
        return value

    @field_validator("cases")
    @classmethod
    def _check_cases(cls, cases: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
        for name, values in cases.items():
            try:
                Faults.from_mapping(values)
            except ValueError as error:
                raise StudyError(f"case '{name}': {error}") from None
        return cases

    @model_validator(mode="after")
    def _check_content(self) -> Self:
        for key in ("models", "fitnesses", "equivalents", "noises_A", "methods"):
            values = getattr(self, key)
            if not values:
                raise StudyError(f"'{key}' is empty, so there is nothing to run; name at least one")
            if len(set(map(str, values))) < len(values):
                raise StudyError(f"'{key}' contains a value twice; give each value once")
        for kind, items in (("methods", self.methods), ("rigs", self.rigs), ("groups", self.groups)):
            labels = [item.label for item in items]
            for label in labels:
                if labels.count(label) > 1:
                    raise StudyError(f"two {kind} are called '{label}'; give each a different label")
        self._check_cases_and_runs()
        self._check_rigs()
        self._check_names()
        return self

    def _check_cases_and_runs(self) -> None:
        if self.groups:
            if self.random is not None:
                raise StudyError("[random] does not go with [[groups]]; give the group a 'random' count")
            for group in self.groups:
                if not group.count:
                    raise StudyError(f"group '{group.label}' has no cases; name some, or give a count")
                self._check_known(f"group '{group.label}'", "case", group.cases, self.cases)
                self._check_known(f"group '{group.label}'", "rig", group.rigs, self.rig_named)
                self._check_known(f"group '{group.label}'", "method", group.methods, self.method_named)
        elif not self.all_cases:
            raise StudyError("no cases, so there is nothing to run; add [cases] or [random]")
        duplicates = self.cases.keys() & (self.random.cases if self.random else {})
        if duplicates:
            raise StudyError(f"case '{min(duplicates)}' has the name of a case of [random]; rename it")
        if self.total > MOST_RUNS:
            raise StudyError(f"{self.total} runs are too many; {MOST_RUNS} are possible: reduce the plan")

    def _check_rigs(self) -> None:
        if self.groups and not self.rigs:
            raise StudyError("[[groups]] need [[rigs]] to run on; add one")
        if self.rigs and self.noises_A != (0.0,):
            raise StudyError("'noises_A' does not go with [[rigs]]; give each rig its 'noise'")
        if self.rigs and self.equivalents != ("torque",):
            raise StudyError("'equivalents' do not go with [[rigs]], which record the torque current")
        for section in self.sections:
            where = f"section '{section.title}'"
            self._check_known(where, "rig", [row.rig for row in section.rows], self.rig_named)
            self._check_known(where, "method", [row.method for row in section.rows], self.method_named)

    def _check_known(self, where: str, kind: str, names: Iterable[str], known: Iterable[str]) -> None:
        options = list(known)
        for name in names:
            if name not in options:
                raise StudyError(f"{where}: unknown {kind} '{name}'{nearest(name, options)}")

    def _check_names(self) -> None:
        for model, fitness, contestant in itertools.product(self.models, self.fitnesses, self.methods):
            method, switches = contestant.chosen(), model_named(model).switches
            check_fitness(method, fitness)
            if method.least_squares and switches:
                raise StudyError(
                    f"method '{contestant.method}' needs derivatives, which the switching of the {model} "
                    f"model prevents; leave out one of the two"
                )

    @classmethod
    def load(cls, name: str | Path) -> Self:
        """Return the built-in plan `name`, or the plan in the TOML file with this path.

        Raises
        ------
        StudyError
            There is no such plan, or it is invalid; the message names file, key and remedy.
        """
        if str(name) in BUILT_IN:
            return cls.from_toml_text(built_in_text(str(name)), where=f"plan '{name}'")
        path = Path(name)
        if not path.suffix and not os.path.exists(path):  # noqa: PTH110 - Path.exists fails on a long name
            raise StudyError(
                f"unknown plan '{name}'{nearest(str(name), BUILT_IN)}; or give the path of its TOML"
            )
        values = read_toml(path, "plan file", StudyError)
        actuator = values.get("actuator")
        # A description next to the plan is preferred.
        if isinstance(actuator, str) and is_file(path.parent / actuator, StudyError):
            values["actuator"] = str(path.parent / actuator)
        return cls._of(values, str(path))

    @classmethod
    def from_toml_text(cls, text: str, *, where: str = "plan") -> Self:
        """Return the plan in a TOML `text`; `where` is its name in error messages."""
        try:
            values = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise StudyError(f"{where}: not valid TOML: {error}; correct the syntax there") from None
        return cls._of(values, where)

    @classmethod
    def _of(cls, values: dict[str, Any], where: str) -> Self:
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            raise StudyError(f"{where}: {_message(error)}") from None

    @property
    def all_cases(self) -> dict[str, dict[str, float]]:
        """The named and the random cases, by name."""
        return {**self.cases, **(self.random.cases if self.random else {})}

    @property
    def rig_named(self) -> dict[str, Rig]:
        """The rigs by label."""
        return {rig.label: rig for rig in self.rigs}

    @property
    def method_named(self) -> dict[str, Contestant]:
        """The methods by label."""
        return {contestant.label: contestant for contestant in self.methods}

    @property
    def facts(self) -> dict[str, str]:
        """Facts on recordings, rigs, methods and seed for readers of the results, by name."""
        m = self.manoeuvre
        chirp = f"chirp of {m.amplitude:g} rad, {m.start_hz:g} to {m.stop_hz:g} Hz in {m.duration:g} s"
        at = f" about {about:g} rad" if (about := m.chirp(self.actuator, m.duration).about) else ""
        rigs = {"Rigs": "; ".join(rig.facts for rig in self.rigs)} if self.rigs else {}
        return {
            "Recordings": f"reference model of '{self.actuator.name}', {chirp}{at}, {m.sample_rate:g} rows/s",
            **rigs,
            "Methods": "; ".join(contestant.described for contestant in self.methods),
            "Seed": str(self.seed),
        }

    @property
    def total(self) -> int:
        """The number of trials."""
        variants = math.prod(map(len, (self.models, self.fitnesses, self.equivalents, self.noises_A)))
        if not self.groups:
            rigs = max(1, len(self.rigs))
            return self.runs * variants * rigs * len(self.all_cases) * len(self.methods)
        return sum(
            group.runs
            * variants
            * group.count
            * len(group.rigs or self.rigs)
            * len(group.methods or self.methods)
            for group in self.groups
        )


def built_in_text(name: str) -> str:
    """Return the TOML of a built-in plan."""
    return files("emaphm.study").joinpath("plans", f"{name}.toml").read_text(encoding="utf-8")


def _message(error: ValidationError) -> str:
    first = error.errors()[0]
    # An error of the plan as a whole has no key.
    return validation_message(error, Plan) if first["loc"] else str(first["ctx"]["error"])
