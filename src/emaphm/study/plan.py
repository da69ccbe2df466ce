"""What a study asks: which methods, on which cases, how often; its TOML, and the tasks that it comes to."""

import hashlib
import itertools
import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.parameters import Section
from emaphm.actuator.toml import validation_message
from emaphm.errors import StudyError, nearest
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.methods import Method, method_named
from emaphm.estimation.search import check_fitness
from emaphm.recording.equivalent_current import Form
from emaphm.simulation import model_named

BUILT_IN = ("thesis", "quick", "hybrids", "forms", "monitor")
"""Plans that come with the package."""

MOST_RUNS = 1_000_000
"""Of a whole plan: each is a file, and a number of seven digits."""

Count = Annotated[int, Field(ge=1, le=MOST_RUNS)]
Label = Annotated[str, Field(min_length=1, max_length=60)]


class Manoeuvre(Section):
    """The chirp that cases are recorded on: amplitude [rad], frequencies [Hz], duration [s], rate [Hz]."""

    amplitude: float = 5e-3
    start_hz: Annotated[float, Field(ge=0)] = 0.0
    stop_hz: Annotated[float, Field(gt=0)] = 15.0
    duration: Annotated[float, Field(gt=0, le=30)] = 0.5
    sample_rate: Annotated[float, Field(gt=0, le=1e5)] = 5000.0


class RandomCases(Section):
    """Cases "random 1" and on: vectors drawn from [0, 1], their shorts from [0, `largest_short`]."""

    count: Count
    seed: Annotated[int, Field(ge=0)] = 0
    largest_short: Annotated[float, Field(ge=0, le=1)] = 0.7

    @property
    def cases(self) -> dict[str, dict[str, float]]:
        """The cases by name."""
        vectors = np.random.default_rng(self.seed).random((self.count, len(NAMES)))
        vectors[:, 2:5] *= self.largest_short
        return {
            f"random {i + 1}": dict(zip(NAMES, map(float, vector), strict=True))
            for i, vector in enumerate(vectors)
        }


class Contestant(BaseModel):
    """A method that takes part: its name, a label where the name is not enough, and settings of its own.

    `turns` bounds the bias corrections of a method that refines, and it estimates `nuisances` besides.
    Any other key is a setting of the optimiser, e.g. population or iterations.
    """

    model_config = ConfigDict(frozen=True, extra="allow")

    method: str
    label: Label
    turns: Annotated[int, Field(ge=0, le=20)] = MAX_CORRECTIONS
    nuisances: tuple[str, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _from_name(cls, values: Any) -> Any:
        if isinstance(values, str):
            values = {"method": values}
        if isinstance(values, Mapping) and "method" in values:
            return {"label": values["method"], **values}
        return values

    @model_validator(mode="after")
    def _exists(self) -> Self:
        self.chosen()
        return self

    @property
    def described(self) -> str:
        """Label, method and settings in one line."""
        settings = [
            f"{name} {value}"
            for name, value in (self.model_extra or {}).items()
            if name not in ("population", "iterations")
        ]
        method = self.chosen()
        if method.optimizer is not None:
            optimizer = method.optimizer(np.zeros(len(NAMES)), np.ones(len(NAMES)))
            settings = [f"{optimizer.population} × {optimizer.iterations}", *settings]
        if method.least_squares:
            settings.append(f"up to {self.turns} corrections")
        return f"{self.label}: {', '.join([method.name, *settings])}"

    def chosen(self) -> Method:
        """Return the method at its settings; `MethodError` where it or one of them is unknown."""
        return method_named(self.method, self.model_extra)


class Plan(Section):
    """A comparison: every case × method × model × fitness × equivalent current × noise, `runs` times each.

    Read from TOML by `load`. A case maps fault names to values in [0, 1]; those left out are healthy.
    """

    name: Label
    description: str = ""
    runs: Count
    seed: Annotated[int, Field(ge=0)] = 0
    actuator: Actuator = Actuator.thesis()
    manoeuvre: Manoeuvre = Manoeuvre()
    models: tuple[str, ...] = ("averaged",)
    fitnesses: tuple[str, ...] = ("least_squares",)
    equivalents: tuple[Form, ...] = ("torque",)
    noises_A: tuple[Annotated[float, Field(ge=0)], ...] = (0.0,)
    cases: dict[Label, dict[str, float]] = Field(default_factory=dict)
    random: RandomCases | None = None
    methods: tuple[Contestant, ...]

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
    def _asks_for_something(self) -> Self:
        for key in ("models", "fitnesses", "equivalents", "noises_A", "methods"):
            values = getattr(self, key)
            if not values:
                raise StudyError(f"'{key}' is empty, so there is nothing to run; name at least one")
            if len(set(map(str, values))) < len(values):
                raise StudyError(f"'{key}' names one twice; name each once")
        self._check_cases_and_runs()
        labels = [contestant.label for contestant in self.methods]
        for label in labels:
            if labels.count(label) > 1:
                raise StudyError(f"two methods are called '{label}'; give each a label of its own")
        self._check_names()
        return self

    def _check_cases_and_runs(self) -> None:
        if not self.all_cases:
            raise StudyError("no cases, so there is nothing to run; add [cases] or [random]")
        twice = self.cases.keys() & (self.random.cases if self.random else {})
        if twice:
            raise StudyError(f"case '{min(twice)}' bears a name of [random]; give it another")
        lists = (self.models, self.fitnesses, self.equivalents, self.noises_A, self.all_cases, self.methods)
        total = self.runs * math.prod(map(len, lists))
        if total > MOST_RUNS:
            raise StudyError(f"{total} runs are too many; {MOST_RUNS} are possible: ask for fewer")

    def _check_names(self) -> None:
        for model, fitness, contestant in itertools.product(self.models, self.fitnesses, self.methods):
            method, switches = contestant.chosen(), model_named(model).switches
            check_fitness(method, fitness)
            if method.least_squares and switches:
                raise StudyError(
                    f"method '{contestant.method}' needs derivatives, which drown in the {model} model's "
                    "switching; leave out one of the two"
                )

    @classmethod
    def load(cls, name: str | Path) -> Self:
        """Return the built-in plan `name`, or the one in the TOML file of that path.

        Raises
        ------
        StudyError
            There is no such plan, or it asks for what cannot be; the message names file, key and remedy.
        """
        if str(name) in BUILT_IN:
            return cls.from_toml_text(built_in_text(str(name)), where=f"plan '{name}'")
        path = Path(name)
        if not path.suffix and not os.path.exists(path):  # noqa: PTH110 - Path.exists fails on a long name
            raise StudyError(
                f"unknown plan '{name}'{nearest(str(name), BUILT_IN)}; or give the path of its TOML"
            )
        try:
            text = path.read_text(encoding="utf-8-sig")
        except FileNotFoundError:
            raise StudyError(f"{path}: no such plan file; give the path of its TOML") from None
        except (OSError, UnicodeDecodeError) as error:
            raise StudyError(f"{path}: cannot be read as a TOML text file ({error})") from None
        return cls.from_toml_text(text, where=str(path), folder=path.parent)

    @classmethod
    def from_toml_text(cls, text: str, *, where: str = "plan", folder: Path | None = None) -> Self:
        """Return the plan in `text`, from `where`; files that it names are sought in `folder` first."""
        try:
            values = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise StudyError(f"{where}: not valid TOML: {error}; correct the syntax there") from None
        actuator = values.get("actuator")
        if folder and isinstance(actuator, str) and (folder / actuator).is_file():
            values["actuator"] = str(folder / actuator)
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            raise StudyError(f"{where}: {_complaint(error)}") from None

    @property
    def all_cases(self) -> dict[str, dict[str, float]]:
        """The named cases and the random ones."""
        return {**self.cases, **(self.random.cases if self.random else {})}

    @property
    def facts(self) -> dict[str, str]:
        """What a reader of the results needs to know, item by item."""
        m = self.manoeuvre
        command = f"chirp of {m.amplitude:g} rad, {m.start_hz:g} to {m.stop_hz:g} Hz in {m.duration:g} s"
        return {
            "Recordings": f"reference model of '{self.actuator.name}', {command}, {m.sample_rate:g} rows/s",
            "Methods": "; ".join(contestant.described for contestant in self.methods),
            "Seed": str(self.seed),
        }

    @property
    def tasks(self) -> "tuple[Task, ...]":
        """All runs; the first runs of every case and method come first, so that half a study tells of all."""
        combinations = itertools.product(
            range(self.runs),
            self.models,
            self.fitnesses,
            self.equivalents,
            self.noises_A,
            self.all_cases.items(),
            self.methods,
        )
        return tuple(
            Task(
                index,
                case,
                tuple(map(float, Faults.from_mapping(values).vector)),
                contestant,
                model,
                fitness,
                form,
                noise,
                run,
                _seed(self.seed, case, run),
            )
            for index, (run, model, fitness, form, noise, (case, values), contestant) in enumerate(
                combinations
            )
        )


@dataclass(frozen=True)
class Task:
    """One run: a method on a case. `index` numbers it in the plan; all randomness comes from `seed`."""

    index: int
    case: str
    truth: tuple[float, ...]
    contestant: Contestant
    model: str
    fitness: str
    equivalent: Literal["torque", "active", "magnitude"]
    noise_A: float
    run: int
    seed: int


def built_in_text(name: str) -> str:
    """Return the TOML of a built-in plan."""
    return files("emaphm.study").joinpath("plans", f"{name}.toml").read_text(encoding="utf-8")


def _complaint(error: ValidationError) -> str:
    first = error.errors()[0]
    # What is wrong with the plan as a whole has no key of its own.
    return validation_message(error, Plan) if first["loc"] else str(first["ctx"]["error"])


def _seed(seed: int, case: str, run: int) -> int:
    """Return a seed that differs between cases and runs, and is the same for every method."""
    digest = hashlib.sha256(f"{seed}/{case}/{run}".encode()).digest()
    return int.from_bytes(digest[:4], "big") >> 1
