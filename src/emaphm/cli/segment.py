"""The verb that cuts a long recording into stretches that identify something."""

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
        Parameter(help="Largest half-width of the 95 % interval of a component that a stretch identifies."),
    ] = 0.1,
    longest: Annotated[float, Parameter(help="Longest stretch [s].")] = 60.0,
    out: Annotated[
        Path | None,
        Parameter(name=("--out", "-o"), help="Folder for the stretches that identify something, as .csv."),
    ] = None,
    common: Common = Common(),  # noqa: B008 - frozen
) -> None:
    """Cut a long recording into stretches that will identify faults, and say why the others will not."""
    from emaphm.experiment.segmentation import check_folder, segments

    common.check()
    described = described_actuator(actuator)
    whole = recording_of(recording, described)
    if out is not None:
        check_folder(out, force=common.force)
    with progress("segmenting", common.as_json) as advance:
        result = segments(
            whole, described, wanted=wanted, longest_s=longest, seed=common.seed, on_progress=advance
        )
    text, values = str(result), result.to_dict()
    if out is not None:
        written = [str(path) for path in result.write(out, force=common.force)]
        text += f"\n{len(written)} recordings written to {out}."
        values["written"] = written
    common.show(values, text)
