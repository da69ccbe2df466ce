"""A rig in closed form: strokes and holds of a current, with scatter of runs and of rows."""

from dataclasses import dataclass

import numpy as np

from emaphm.recording import Recording

ROWS = 120
INTERVAL = 0.04
COMMAND = np.interp(np.arange(ROWS), [0, 45, 75, ROWS], [0.02, 0.14, 0.14, 0.02])
"""Up-stroke, hold and down-stroke [m]."""

WAY = np.sign(np.diff(COMMAND, append=0.02))


@dataclass(frozen=True)
class Rig:
    """Friction and load as currents [A], an extra current on the up-stroke, and the noise [A] of a row."""

    friction: float = 0.8
    per_newton: float = 5e-4
    extra_up: float = 0.0
    noise: float = 0.05
    run_scatter: float = 0.02

    def run(self, rng: np.random.Generator, cycles: int = 1, load: float = 200.0) -> list[Recording]:
        """Return the cycles of a run, which share a deviation of friction."""
        friction = self.friction * (1 + self.run_scatter * rng.normal())
        return [self._cycle(rng, friction, load) for _ in range(cycles)]

    def _cycle(self, rng: np.random.Generator, friction: float, load: float) -> Recording:
        size = np.where(WAY == 0, 0.35, friction - WAY * self.per_newton * load)
        size = size + self.extra_up * (WAY > 0) + self.noise * rng.normal(size=ROWS)
        return Recording(
            {
                "time_s": np.arange(ROWS) * INTERVAL,
                "command_rad": COMMAND,
                "current_A": size,
                "position_rad": COMMAND + 1e-4 * rng.normal(size=ROWS),
                "load_Nm": np.full(ROWS, load),
            },
            "instant",
            "rig",
        )


def runs(
    rig: Rig, count: int, seed: int, cycles: int = 1, load: float = 200.0
) -> tuple[list[Recording], list[int]]:
    """Return the cycles of `count` runs, and which run each is of."""
    rng = np.random.default_rng(seed)
    every = [rig.run(rng, cycles, load) for _ in range(count)]
    return [one for run in every for one in run], [k for k, run in enumerate(every) for _ in run]
