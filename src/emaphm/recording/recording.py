"""A recording: the measured channels of an actuator that follows a command."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from emaphm.actuator.channels import SAMPLINGS, Sampling
from emaphm.actuator.quantity import Coordinates, unit_for
from emaphm.arrays import Array, floats
from emaphm.errors import RecordingError, nearest
from emaphm.recording.checks import check
from emaphm.recording.resampling import on_uniform_grid
from emaphm.recording.schema import SCHEMA

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

Label = float | str


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Uniformly sampled channels of one manoeuvre.

    Rows whose times jitter are resampled to a constant rate, with a note (`emaphm.recording.resampling`).

    Parameters
    ----------
    channels
        Columns of shape (n,) by name, in SI units, stored as read-only copies. Names and units of the
        schema's columns are in `emaphm.recording.schema.SCHEMA`; other columns are not changed. A timedelta64
        is converted to seconds, a masked value to NaN, which means missing.
    sampling
        "mean" if row n is the mean over [t_n, t_n + interval), "instant" if it is the value at t_n
        (docs/physics.md, section 7).
    source
        File name or description, for error messages and titles.
    notes
        Sentences on changes of the channels and on channels that cannot be used; a single string is one note.
    labels
        Properties of the whole recording by name, as numbers or texts: the run, the cycle, the unit's serial
        number ("serial").

    Raises
    ------
    RecordingError
        `sampling` is unknown, or the columns do not pass `emaphm.recording.checks.check`.
    """

    channels: Mapping[str, Array]
    sampling: Sampling = "mean"
    source: str = "recording"
    notes: tuple[str, ...] = ()
    labels: Mapping[str, Label] = field(default_factory=dict)

    def __init__(
        self,
        channels: Mapping[str, ArrayLike],
        sampling: Sampling = "mean",
        source: str = "recording",
        notes: Sequence[str] = (),
        labels: Mapping[str, Label] = MappingProxyType({}),
    ) -> None:
        if sampling not in SAMPLINGS:
            raise RecordingError(
                f"{source}: unknown sampling '{sampling}'{nearest(str(sampling), SAMPLINGS)}"
            )
        columns = {name: _read_only(values, name, source) for name, values in channels.items()}
        check(columns, source)
        columns, resampled = on_uniform_grid(columns, sampling)
        object.__setattr__(self, "channels", MappingProxyType(columns))
        object.__setattr__(self, "sampling", sampling)
        object.__setattr__(self, "source", source)
        # A recording derived from another repeats its notes: duplicates are removed.
        object.__setattr__(self, "notes", tuple(dict.fromkeys((*_as_sequence(notes), *resampled))))
        object.__setattr__(self, "labels", MappingProxyType(dict(labels)))

    def __reduce__(self) -> tuple[Any, ...]:
        # A mapping proxy cannot be pickled, and worker processes need recordings.
        return Recording, (dict(self.channels), self.sampling, self.source, self.notes, dict(self.labels))

    def __getitem__(self, name: str) -> Array:
        """Return column `name`, shape (n,), read-only; an unknown name raises `RecordingError`."""
        try:
            return self.channels[name]
        except KeyError:
            hint = nearest(name, self.channels)
            raise RecordingError(f"{self.source}: no column '{name}'{hint}; ask for one it has") from None

    def __contains__(self, name: object) -> bool:
        """Return whether there is a column `name`."""
        return name in self.channels

    def __iter__(self) -> Iterator[str]:
        """Iterate over the column names."""
        return iter(self.channels)

    def with_channels(self, channels: Mapping[str, ArrayLike], notes: Sequence[str] = ()) -> "Recording":
        """Return the recording with `channels` as its columns and `notes` added to its notes."""
        return Recording(
            channels, self.sampling, self.source, (*self.notes, *_as_sequence(notes)), self.labels
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Column names, in their order."""
        return tuple(self.channels)

    @property
    def samples(self) -> int:
        """Number of rows n."""
        return self.channels["time_s"].size

    @property
    def interval_s(self) -> float:
        """Mean time between rows [s]."""
        time = self.channels["time_s"]
        return float(time[-1] - time[0]) / (time.size - 1)

    @property
    def sample_rate_hz(self) -> float:
        """Rows per second [Hz]."""
        return 1 / self.interval_s

    @property
    def duration_s(self) -> float:
        """Time covered [s]: each row stands for one interval."""
        return self.samples * self.interval_s

    def to_frame(self) -> "pl.DataFrame":
        """Return the columns as a polars frame."""
        import polars as pl

        return pl.DataFrame(dict(self.channels))

    def plot(self, names: Sequence[str] | None = None, *, coordinates: Coordinates = "rotary") -> "Figure":
        """Draw columns over time, stacked, with units.

        Parameters
        ----------
        names
            Columns to draw; all except time if omitted.
        coordinates
            Units of the labels: "rotary" rad and N·m, "linear" m and N, "screw" m at the user.

        Raises
        ------
        RecordingError
            A name is not in the recording, or `names` is empty.
        """
        from matplotlib.figure import Figure

        drawn = [name for name in self.names if name != "time_s"] if names is None else list(names)
        if not drawn:
            raise RecordingError(f"{self.source}: no columns to draw; give names of some")
        figure = Figure(figsize=(8, 1 + 1.3 * len(drawn)), layout="constrained")
        axes = figure.subplots(len(drawn), 1, sharex=True, squeeze=False)[:, 0]
        for axis, name in zip(axes, drawn, strict=True):
            axis.plot(self["time_s"], self[name], linewidth=1)
            axis.set_ylabel(_axis_label(name, coordinates), fontsize="small")
            axis.grid(alpha=0.3)
        axes[-1].set_xlabel("time [s]")
        figure.suptitle(self.source, fontsize="medium", parse_math=False)
        return figure

    def __repr__(self) -> str:
        sampling = "interval means" if self.sampling == "mean" else "instants"
        rate = f"{self.sample_rate_hz:.6g} Hz, {self.duration_s:.6g} s"
        width = max(map(len, self.names))
        ranges = (
            f"  {name:<{width}}  {values.min():.4g} to {values.max():.4g}"
            for name, values in self.channels.items()
        )
        notes = (f"  Note: {note}" for note in self.notes)
        head = f"Recording '{self.source}': {self.samples} rows ({sampling}) at {rate}"
        return "\n".join((head, *ranges, *notes))


def _as_sequence(notes: Sequence[str]) -> Sequence[str]:
    """Return notes as a sequence of sentences: a single string is one note, not a sequence of letters."""
    return (notes,) if isinstance(notes, str) else notes


def _read_only(values: ArrayLike, name: str, source: str) -> Array:
    try:
        column = floats(values)
    except TypeError as error:
        raise RecordingError(f"{source}: column '{name}' is {error}") from None
    column.setflags(write=False)
    return column


def _axis_label(name: str, coordinates: str) -> str:
    if name not in SCHEMA:
        return name
    return f"{SCHEMA[name].meaning}\n[{unit_for(SCHEMA[name].unit, coordinates)}]"
