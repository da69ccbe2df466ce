"""`python -m tests.server.hostile`: 200 malicious uploads, and the answers of the server.

File names that are paths, files of a wrong type, bombs that unpack to gigabytes, truncated, invalid or
endless forms, a declared length of two gigabytes. The server must not write outside of its folder, its
memory must stay bounded, no upload may be diagnosed, and the server must still answer at the end.
"""

import argparse
import gzip
import io
import pickle
import random
import socket
import struct
import sys
import tempfile
import threading
import time
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import polars as pl

from .flights import as_csv, flight
from .made_up import fill
from .process import Server, form, over, serving

FIELDS = {"unit": "SN-0001", "hours": "900"}

NAMES = (
    "../../../../pwned.csv",
    "/tmp/pwned.csv",  # noqa: S108 - it must not be written
    "..\\..\\pwned.csv",
    "C:\\pwned.csv",
    "pwned.csv/..",
    "%2e%2e%2fpwned.csv",
    "file:///pwned.csv",
    "~/pwned.csv",
    "$(touch pwned).csv",
    "`touch pwned`.csv",
    "; touch pwned;.csv",
    "<script>alert(1)</script>.csv",
    "{{ 7 * 7 }}.csv",
    "nul.csv",
    "a" * 5000 + ".csv",
    "\u202ecsv.exe",
    ".csv",
    ".",
    "..",
    "",
)
KINDS = (
    "csv",
    "parquet",
    "mat",
    "h5",
    "hdf5",
    "tdms",
    "mf4",
    "exe",
    "pkl",
    "npy",
    "zip",
    "toml",
    "py",
    "svg",
)

DECLARED = 2 * 2**30


class Marker:
    """Object whose unpickling creates a file."""

    def __reduce__(self) -> tuple[Callable[..., object], tuple[str, str]]:
        """Return the call that is executed by unpickling."""
        return open, ("pwned", "w")


def contents(dice: random.Random) -> Iterator[tuple[str, bytes]]:
    """Yield file names with contents."""
    good = as_csv(flight(), 1)
    for name in NAMES:
        yield name, b"time_s,command_rad\n0,0\n"
    for kind in KINDS:
        yield f"random.{kind}", dice.randbytes(20_000)
        yield f"empty.{kind}", b""
        yield f"csv.{kind}", good if kind != "csv" else good[: len(good) // 2] + b'"\0'
        yield f"pickle.{kind}", pickle.dumps(Marker())
    for kind, content in bombs().items():
        yield f"bomb.{kind}", content
    yield "numbers.csv", b"time_s,command_rad,current_A\n" + b"1e999,nan,-inf\n" * 10_000
    yield "columns.csv", b",".join(b"c%d" % i for i in range(200_000)) + b"\n1"
    yield "line.csv", b"1" * 20_000_000
    yield "quotes.csv", b'"' * 1_000_000
    yield "utf16.csv", good.decode().encode("utf-16")
    yield "formula.csv", good.replace(b"time_s", b"=cmd|'/C calc'!A0")


def bombs() -> dict[str, bytes]:
    """Return small files that unpack to gigabytes, keyed by file-name extension."""
    import h5py

    parquet, hdf = io.BytesIO(), io.BytesIO()
    zeros = np.zeros(30_000_000)
    pl.DataFrame({"time_s": zeros, "command_rad": zeros, "current_A": zeros}).write_parquet(parquet)
    with h5py.File(hdf, "w") as file:
        for name in ("time_s", "command_rad", "current_A"):
            file.create_dataset(name, (400_000_000,), "f8", chunks=(1_000_000,), compression="gzip")
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.csv", bytes(200_000_000))
    return {
        "parquet": parquet.getvalue(),
        "h5": hdf.getvalue(),
        "hdf5": hdf.getvalue()[:5000],
        "mat": _mat_bomb(),
        "csv": gzip.compress(bytes(200_000_000)),
        "zip": packed.getvalue(),
        "xlsx": packed.getvalue(),
    }


def _mat_bomb() -> bytes:
    """Return a MATLAB file whose one compressed variable unpacks to a gigabyte."""
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H2s", 0x0100, b"IM")
    packer, content = zlib.compressobj(9), b""
    content += packer.compress(struct.pack("<II", 14, 10**9))
    for _ in range(1000):
        content += packer.compress(bytes(10**6))
    content += packer.flush()
    return header + struct.pack("<II", 15, len(content)) + content


def forms(dice: random.Random) -> Iterator[bytes]:
    """Yield malformed requests as bytes on the wire."""
    kind, body = form("a.csv", b"time_s\n0\n", FIELDS)
    yield request(kind, body, DECLARED)
    yield request(kind, body, 10**30)
    yield request(kind, body, -1)
    yield request("multipart/form-data", body)
    yield request("multipart/form-data; boundary=", body)
    yield request("multipart/form-data; boundary=" + "x" * 10_000, body)
    yield request("multipart/form-data; boundary=x; charset=unicode_escape", body)
    yield request("application/json", b"[" * 50_000)
    yield request("application/x-www-form-urlencoded", b"unit=" + b"x" * 500_000)
    for charset in ("utf-7", "idna", "punycode", "zlib", "\\0", "x" * 500):
        yield request(f"{kind}; charset={charset}", body)
    for name in ("unit", "hours", "cycles", "position", "part", "actuator", "late"):
        for value in (
            "\0",
            "\ud800".encode("utf-8", "surrogatepass").decode("latin-1"),
            "9" * 5000,
            "-0",
            "nan",
        ):
            kind, body = form("a.csv", b"time_s\n0\n", FIELDS | {name: value})
            yield request(kind, body)
        kind, body = form("a.csv", b"time_s\n0\n", FIELDS | {name: "x" * 2_000_000})
        yield request(kind, body)
    many = {f"field{i}": "x" for i in range(5000)}
    yield request(*form("a.csv", b"", many))
    yield b"POST /api/v1/recordings HTTP/1.1\r\nHost: 127.0.0.1\r\n" + b"X: y\r\n" * 100_000 + b"\r\n"
    for _ in range(30):
        kind, body = form("a.csv", b"time_s\n0\n", FIELDS)
        spoilt = bytearray(body)
        for _ in range(dice.randrange(1, 20)):
            spoilt[dice.randrange(len(spoilt))] = dice.randrange(256)
        yield request(kind, bytes(spoilt))


def request(kind: str, body: bytes, length: int | None = None) -> bytes:
    """Return an upload request as bytes on the wire."""
    head = (
        "POST /api/v1/recordings HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n"
        f"Content-Type: {kind}\r\nContent-Length: {len(body) if length is None else length}\r\n\r\n"
    )
    return head.encode("latin-1", "replace") + body


def sent(server: Server, wire: bytes, *, cut: bool = False) -> int:
    """Return the status of the answer, or 0 if the connection is closed without an answer.

    With `cut`, the sending direction is closed after `wire`, as by a client that disconnects.
    """
    host, _, port = server.address.rpartition(":")
    with socket.create_connection((host, int(port)), timeout=20) as connection:
        try:
            connection.sendall(wire)
            if cut:
                connection.shutdown(socket.SHUT_WR)
        except OSError:
            pass  # the server may answer before everything is sent
        try:
            answer = connection.recv(20)
        except OSError:
            return 0
    return int(answer.split()[1]) if answer.startswith(b"HTTP") else 0


def endless(server: Server) -> int:
    """Send an endless chunked body; return the status of the answer, or 0 without an answer."""
    host, _, port = server.address.rpartition(":")
    head = "POST /api/v1/recordings HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n"
    kind = "Content-Type: multipart/form-data; boundary=x\r\n\r\n"
    start = b'--x\r\nContent-Disposition: form-data; name="recording"; filename="a.csv"\r\n\r\n'
    chunk = b"100000\r\n" + bytes(0x100000) + b"\r\n"
    with socket.create_connection((host, int(port)), timeout=60) as connection:
        try:
            connection.sendall((head + kind).encode() + b"%x\r\n%s\r\n" % (len(start), start))
            for _ in range(1000):
                connection.sendall(chunk)
        except OSError:
            pass
        try:
            answer = connection.recv(20)
        except OSError:
            return 0
    return int(answer.split()[1]) if answer.startswith(b"HTTP") else 0


def outside(folder: Path) -> set[Path]:
    """Return the files outside of the server's own folder."""
    own = folder / "fleet.sqlite.serve"
    foreign = {path for path in folder.rglob("*") if own not in path.parents and path != own}
    return foreign | set(Path(tempfile.gettempdir()).glob("pwned*")) | set(Path("/").glob("pwned*"))


def main() -> int:
    """Print the server's answers, time and memory."""
    parser = argparse.ArgumentParser(prog="python -m tests.server.hostile", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    dice = random.Random(arguments.seed)
    memory, stop, answers, states = [], threading.Event(), Counter[int](), Counter[str]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = folder / "fleet.sqlite"
        fill(file, 3)
        with serving(file) as server:

            def watch() -> None:
                while not stop.wait(0.1):
                    memory.append(server.memory())

            server.get("/")
            before, start = outside(folder), time.perf_counter()
            watching = threading.Thread(target=watch)
            watching.start()
            wires = [request(*form(name, content, FIELDS)) for name, content in contents(dice)]
            wires += list(forms(dice))
            for wire in wires:
                answers[sent(server, wire)] += 1
            kind, body = form("a.csv", b"time_s\n0\n", FIELDS)
            for length in range(0, len(body), len(body) // 20):
                answers[sent(server, request(kind, body[:length], len(body)), cut=True)] += 1
            answers[endless(server)] += 1
            jobs = server.json("/api/v1/jobs?limit=1000")["jobs"]
            for job in jobs:
                states[over(server, job["id"])["state"]] += 1
            alive = server.get("/")[0] == 200
            stop.set()
            watching.join()
            after = {path for path in outside(folder) if not path.name.startswith("fleet.sqlite")}
            written = sorted(after - before)
            waiting = len(list((folder / "fleet.sqlite.serve" / "uploads").iterdir()))
    elapsed = time.perf_counter() - start
    print(f"{sum(answers.values())} uploads in {elapsed:.0f} s, answered by {dict(sorted(answers.items()))}")
    print(f"(0: the connection was closed), of the {len(jobs)} accepted ones: {dict(states)}")
    print(f"files written elsewhere: {[str(path) for path in written]}; uploads kept: {waiting}")
    print(f"memory of the server and its processes: {max(memory):.0f} MiB at most; alive: {alive}")
    defects = sum(count for status, count in answers.items() if status >= 500 and status != 503)
    return 1 if defects or written or not alive or states["done"] else 0


if __name__ == "__main__":
    sys.exit(main())
