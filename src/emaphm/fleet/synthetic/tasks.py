"""Tasks of workers for a synthetic fleet: recording of a unit's check flights, diagnosis of one of them."""

from pathlib import Path

from emaphm.actuator import Actuator
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.errors import RecordingError
from emaphm.execution.revision import check_revision
from emaphm.fleet.synthetic.folder import CheckFlight, FleetFolder, revision
from emaphm.fleet.synthetic.plan import FleetPlan
from emaphm.fleet.synthetic.recordings import check_flight
from emaphm.fleet.synthetic.unit import drawn_unit
from emaphm.output_files import make_folder
from emaphm.recording import Recording, read_recording
from emaphm.recording.io.write import write_recording


def record_unit(folder: str, plan: FleetPlan, number: int, actuator: Actuator, expected: str) -> int:
    """Write the missing recordings of a unit, and return their number.

    Raises
    ------
    ExecutionError
        The code of this worker has not the revision `expected`.
    OutputError
        A file cannot be written.
    """
    check_revision(revision(), expected, "fleet")
    place, unit, written = FleetFolder(Path(folder)), drawn_unit(plan, number), 0
    make_folder(place.path / "recordings" / unit.serial_number)
    for flight in place.flights(unit, plan):
        if not flight.path.exists():
            recording = check_flight(unit, flight.hours, plan, actuator, flight.number)
            write_recording(recording, flight.path, force=True)
            written += 1
    return written


def diagnose_flight(
    flight: CheckFlight, actuator: Actuator, seed: int, expected: str
) -> tuple[Recording, Diagnosis]:
    """Return the recording of a check flight and its diagnosis; errors as in `record_unit` and `diagnose`."""
    check_revision(revision(), expected, "fleet")
    try:
        recording = read_recording(flight.path, actuator)
    except RecordingError as error:
        raise RecordingError(f"{error}; or remove it: the same command makes it again") from None
    return recording, diagnose(recording, actuator, seed=seed, workers=1)
