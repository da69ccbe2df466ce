"""The verb `segment`: cuts a long recording into stretches that identify faults."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from emaphm.cli.options import (
    ActuatorFile,
    Common,
    RecordingFile,
    described_actuator,
    recording_of,
)
from emaphm.cli.output import progress


def segment(
    recording: RecordingFile,
    *,
    actuator: ActuatorFile = "thesis",
    wanted: Annotated[
        float,
        Parameter(
            help="Largest half-width of a component's 95 % interval for which a stretch counts as "
            "identifying the component."
        ),
    ] = 0.1,
    longest: Annotated[float, Parameter(help="Longest duration of a stretch [s].")] = 60.0,
    out: Annotated[
        Path | None,
        Parameter(
            name=("--out", "-o"),
            help="Folder for the stretches that identify at least one component, as .csv.",
        ),
    ] = None,
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Cut a long recording into stretches that will identify faults, with the reasons for unsuitable ones."""
    from emaphm.experiment.segmentation import check_folder, segments

    common.check()
    described = described_actuator(actuator)
    recorded = recording_of(recording, described)
    if out is not None:
        check_folder(out, force=common.force, source=recording)
    with progress("segmenting", common.as_json) as advance:
        result = segments(
            recorded, described, wanted=wanted, longest_s=longest, seed=common.seed, on_progress=advance
        )
    text, values = str(result), result.to_dict()
    if out is not None:
        from emaphm.text_table import counted

        written = [str(path) for path in result.write(out, force=common.force)]
        text += f"\n{counted(len(written), 'recording')} written to {out}."
        values["written"] = written
    common.show(values, text)
