"""Files of short recordings, and settings for a quick diagnosis."""

from pathlib import Path

from cases import THESIS
from emaphm.actuator import Chirp, Faults
from emaphm.fleet import DiagnosisSettings
from emaphm.recording import Recording, write_recording
from emaphm.simulated_recording import simulate

QUICK = DiagnosisSettings(max_corrections=0, nuisances=())


def recorded(seed: int, faults: Faults = Faults()) -> Recording:  # noqa: B008 - frozen
    """Return a recording of the usual channels, with the sensor noise of the demonstration."""
    simulated = simulate(THESIS, Chirp(duration=0.1), faults=faults, duration=0.1, noise=0.05, seed=seed)
    return Recording({name: simulated[name] for name in ("time_s", "command_rad", "current_A")})


def written(folder: Path, count: int) -> list[Path]:
    """Write `count` recordings with different friction; return their files."""
    folder.mkdir(exist_ok=True)
    paths = [folder / f"day{i}.csv" for i in range(count)]
    for i, path in enumerate(paths):
        write_recording(recorded(i, Faults(friction=0.15 * i)), path)
    return paths
