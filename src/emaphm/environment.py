"""Description of this installation: versions, cores, the cache of compiled kernels, and optional extras."""

import os
import platform
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Any

from emaphm.text_table import NOTHING, format_table
from emaphm.version import VERSION

CORE = ("numpy", "scipy", "numba", "llvmlite", "polars", "pydantic", "matplotlib")
"""Packages whose version may change a result or its computing time."""

PURPOSES = {
    "cluster": "studies and batches on a Dask cluster",
    "detection": "emaphm detect",
    "files": "recordings in TDMS, HDF5, MATLAB 7.3 and MDF files",
    "history": "emaphm history and prognose",
    "peers": "optimisers of other libraries",
    "posterior": "emaphm diagnose --posterior",
    "server": "emaphm serve",
    "train": "emaphm train; not needed to use an estimator",
}
"""Purpose of each extra."""


@dataclass(frozen=True)
class Extra:
    """An optional set of packages: its purpose, installed versions and missing packages."""

    name: str
    purpose: str
    versions: dict[str, str]
    missing: tuple[str, ...]

    @property
    def installed(self) -> bool:
        """Whether all its packages are installed."""
        return bool(self.versions) and not self.missing


@dataclass(frozen=True)
class Environment:
    """The installation in which this program runs."""

    python: str
    system: str
    cores: int
    versions: dict[str, str]
    kernel_folder: Path
    kernels: int
    writable: bool
    extras: tuple[Extra, ...]

    @property
    def remarks(self) -> list[str]:
        """Problems of the installation, each with its remedy."""
        if self.writable:
            return []
        remark = (
            f"compiled kernels cannot be stored in {self.kernel_folder}: every start compiles them again, "
            "which takes some seconds; set EMAPHM_CACHE_DIR to a folder with write permission"
        )
        return [remark]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        return {
            "version": VERSION,
            "python": self.python,
            "system": self.system,
            "cores": self.cores,
            "packages": self.versions,
            "kernel_cache": {
                "folder": str(self.kernel_folder),
                "kernels": self.kernels,
                "writable": self.writable,
            },
            "extras": {
                extra.name: {
                    "purpose": extra.purpose,
                    "installed": extra.installed,
                    "packages": extra.versions,
                    "missing": list(extra.missing),
                }
                for extra in self.extras
            },
            "remarks": self.remarks,
        }

    def __str__(self) -> str:
        """Return everything as text."""
        versions = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        kernels = f"{self.kernels} compiled kernels in {self.kernel_folder}"
        rows = [
            (
                extra.name,
                "installed" if extra.installed else f"pip install 'emaphm[{extra.name}]'",
                ", ".join(f"{name} {number}" for name, number in extra.versions.items()) or NOTHING,
                extra.purpose,
            )
            for extra in self.extras
        ]
        lines = [
            f"emaphm {VERSION}, Python {self.python}, {self.system}, {self.cores} cores",
            versions,
            kernels,
            "",
            format_table(("extra", "state", "packages", "purpose"), rows),
            *(["", *self.remarks] if self.remarks else []),
        ]
        return "\n".join(lines)


def environment() -> Environment:
    """Return the description of this installation."""
    from emaphm.simulation.engine.kernel_cache import ENDING, kernel_folder

    folder = kernel_folder()
    nearest_existing = next(place for place in (folder, *folder.parents) if place.exists())
    return Environment(
        python=platform.python_version(),
        system=f"{platform.system()} {platform.machine()}",
        cores=len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1,
        versions={name: _version(name) or "missing" for name in CORE},
        kernel_folder=folder,
        kernels=len(list(folder.glob(f"*{ENDING}"))) if folder.is_dir() else 0,
        writable=os.access(nearest_existing, os.W_OK),
        extras=tuple(_extras()),
    )


def _extras() -> Iterator[Extra]:
    packages: dict[str, list[str]] = {name: [] for name in PURPOSES}
    for requirement in requires("emaphm") or []:
        match = re.fullmatch(r"([\w.-]+).*;\s*extra == ['\"]([\w-]+)['\"]", requirement)
        if match and match[2] in packages:
            packages[match[2]].append(match[1])
    for name, purpose in PURPOSES.items():
        versions = {package: _version(package) for package in sorted(packages[name])}
        yield Extra(
            name,
            purpose,
            {package: number for package, number in versions.items() if number},
            tuple(package for package, number in versions.items() if number is None),
        )


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
