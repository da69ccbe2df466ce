"""The JSON file of a detector: writing, and reading with a check of all sizes."""

import json
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from emaphm.actuator import Actuator
from emaphm.detection.content import DetectorContent
from emaphm.detection.features import feature_names
from emaphm.detection.level import Level
from emaphm.detection.manoeuvre import HealthyAtLoad, HealthyManoeuvre
from emaphm.detection.seeded import Seeded
from emaphm.detection.segments import StrokeSegment
from emaphm.detection.settings import DETECTOR, DetectorSettings
from emaphm.detection.statistics import HealthyScatter
from emaphm.errors import MethodError
from emaphm.input_files import is_newer_format, read_bytes
from emaphm.output_files import written_whole
from emaphm.version import VERSION

Content = TypeVar("Content", bound=DetectorContent)

FORMAT = "emaphm detector 1"

MOST_BYTES = 256 * 2**20
"""Largest file that is read [bytes]; a detector of ten channels and fifty segments has about 60 MB."""

Row = list[float]
Matrix = list[list[float]]
Positive = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=False)


class _StrokeSegment(_Part):
    first: Count
    stop: Count
    stroke: Literal["up-stroke", "down-stroke", "hold"]


class _Load(_Part):
    load: Row
    mean: Matrix
    centre: Row
    recorded: bool = True  # older files lack it; in these, an unrecorded load is a load of 0


class _Level(_Part):
    cycles: Annotated[int, Field(ge=1)]
    scale: list[Positive]
    directions: Matrix
    variances: list[Positive]
    rank: Annotated[int, Field(ge=1)]
    t2_threshold: Positive
    q_threshold: Annotated[float, Field(ge=0)]
    energy: Annotated[float, Field(ge=0)]
    alarms: Count
    runs: Annotated[int, Field(ge=2)]
    independent: Positive | None = None  # older files lack it; it is then the number of runs


class _HealthyManoeuvre(_Part):
    command: Row
    interval_s: Positive
    segments: Annotated[list[_StrokeSegment], Field(min_length=1)]
    scales: list[Positive]
    loads: Annotated[list[_Load], Field(min_length=1)]
    levels: Annotated[list[_Level], Field(min_length=1)]
    drifting: list[Count]


class _Seeded(_Part):
    fault: str
    manoeuvre: Count
    load: Count
    deviation: Row


class _DetectorFile(_Part):
    format: Literal["emaphm detector 1"]
    version: str
    channels: Annotated[list[str], Field(min_length=1)]
    settings: dict[str, float]
    actuator: dict[str, Any] | None
    manoeuvres: Annotated[list[_HealthyManoeuvre], Field(min_length=1)]
    seeded: list[_Seeded]

    @model_validator(mode="after")
    def _sizes_agree(self) -> Self:
        settings = _settings(self.settings)
        for manoeuvre in self.manoeuvres:
            features = _count_features(manoeuvre, self.channels, settings)
            _check_sizes(manoeuvre, len(self.channels), features)
        for seeded in self.seeded:
            if seeded.manoeuvre >= len(self.manoeuvres):
                raise ValueError("a seeded fault is of a manoeuvre that the detector lacks")
            known = self.manoeuvres[seeded.manoeuvre]
            if seeded.load >= len(known.loads) or len(seeded.deviation) != len(known.loads[0].centre):
                raise ValueError("a seeded fault has another size than its manoeuvre")
        return self


def write_detector(detector: DetectorContent, path: str | Path) -> None:
    """Write a detector as JSON; `OutputError` if it cannot be written."""
    content = {
        "format": FORMAT,
        "version": VERSION,
        "channels": list(detector.channels),
        "settings": asdict(detector.settings),
        "actuator": detector.actuator.model_dump(mode="json", exclude_none=True)
        if detector.actuator
        else None,
        "manoeuvres": [_manoeuvre_dict(manoeuvre) for manoeuvre in detector.manoeuvres],
        "seeded": [asdict(seeded) for seeded in detector.seeded],
    }
    text = json.dumps(content, allow_nan=False, default=np.ndarray.tolist)
    with written_whole(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read_detector(path: Path, kind: type[Content]) -> Content:
    """Return the detector in a JSON file, as an object of the class `kind`.

    Raises
    ------
    MethodError
        The file is absent, too large, or no detector.
    """
    content = read_bytes(path, MOST_BYTES, MethodError)
    try:
        file = _DetectorFile.model_validate_json(content)
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        where = f"'{place}': " if place else ""
        if place == "format" and is_newer_format(first["input"], FORMAT):
            raise MethodError(
                f"{path}: is of the format '{first['input'][:40]}', this emaphm {VERSION} reads '{FORMAT}'; "
                "update emaphm"
            ) from None
        raise MethodError(
            f"{path}: no detector ({where}{first['msg']}); write one with 'emaphm detect learn'"
        ) from None
    actuator = None if file.actuator is None else Actuator.from_dict(file.actuator, where=str(path))
    return kind(
        tuple(file.channels),
        tuple(_manoeuvre(manoeuvre) for manoeuvre in file.manoeuvres),
        actuator,
        tuple(
            Seeded(seeded.fault, seeded.manoeuvre, seeded.load, np.array(seeded.deviation))
            for seeded in file.seeded
        ),
        _settings(file.settings),
    )


def _settings(values: dict[str, float]) -> DetectorSettings:
    unknown = [name for name in values if not hasattr(DETECTOR, name)]
    if unknown:
        raise ValueError(f"unknown setting '{unknown[0]}'")
    typed: dict[str, Any] = {
        name: int(value) if isinstance(getattr(DETECTOR, name), int) else value
        for name, value in values.items()
    }
    return replace(DETECTOR, **typed)


def _manoeuvre_dict(manoeuvre: HealthyManoeuvre) -> dict[str, Any]:
    values = asdict(manoeuvre)
    return values | {"levels": [_level_dict(level) for level in values["levels"]]}


def _level_dict(values: dict[str, Any]) -> dict[str, Any]:
    """Return the `values` of a level with the values of its scatter on the same level."""
    return {"cycles": values.pop("cycles"), **values.pop("scatter"), **values}


def _manoeuvre(held: _HealthyManoeuvre) -> HealthyManoeuvre:
    return HealthyManoeuvre(
        np.array(held.command),
        held.interval_s,
        tuple(StrokeSegment(s.first, s.stop, s.stroke) for s in held.segments),
        np.array(held.scales),
        tuple(held.drifting),
        tuple(
            HealthyAtLoad(np.array(at.load), np.array(at.mean), np.array(at.centre), at.recorded)
            for at in held.loads
        ),
        tuple(
            Level(
                cycles=level.cycles,
                scatter=HealthyScatter(
                    np.array(level.scale), np.array(level.directions), np.array(level.variances), level.rank
                ),
                t2_threshold=level.t2_threshold,
                q_threshold=level.q_threshold,
                energy=level.energy,
                alarms=level.alarms,
                runs=level.runs,
                independent=level.independent or float(level.runs),
            )
            for level in held.levels
        ),
    )


def _count_features(held: _HealthyManoeuvre, channels: list[str], settings: DetectorSettings) -> int:
    segments = [StrokeSegment(s.first, s.stop, s.stroke) for s in held.segments]
    return len(feature_names(channels, segments, settings))


def _check_sizes(held: _HealthyManoeuvre, channels: int, features: int) -> None:
    rows = len(held.command)
    edges = [(s.first, s.stop) for s in held.segments]
    adjoin = edges[0][0] == 0 and edges[-1][1] == rows and all(a < b for a, b in edges)
    adjoin = adjoin and all(before[1] == after[0] for before, after in pairwise(edges))
    agree = adjoin and len(held.scales) == channels
    agree = agree and all(place < len(held.loads) for place in held.drifting)
    for at in held.loads:
        agree = agree and len(at.load) == rows and len(at.centre) == features
        agree = agree and _shape(at.mean) == (rows, channels)
    for level in held.levels:
        agree = agree and len(level.scale) == len(level.variances) == features and level.rank <= features
        agree = agree and _shape(level.directions) == (features, features)
    if not agree or held.levels[0].cycles != 1:
        raise ValueError("the sizes of a manoeuvre's parts do not agree")


def _shape(matrix: Matrix) -> tuple[int, int]:
    widths = {len(row) for row in matrix}
    return len(matrix), widths.pop() if len(widths) == 1 else -1
