"""`emaphm serve` as a process of its own, as a user starts it, and what it takes of the machine."""

import contextlib
import http.client
import json
import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

ROOT = Path(__file__).resolve().parents[2]

PATIENCE_S = 120.0


@dataclass
class Client:
    """Who asks a server."""

    address: str

    def connection(self, timeout: float = 60.0) -> http.client.HTTPConnection:
        """Return a connection to it."""
        return http.client.HTTPConnection(self.address, timeout=timeout)

    def get(self, path: str) -> tuple[int, bytes]:
        """Return status and body of a page."""
        with contextlib.closing(self.connection()) as connection:
            connection.request("GET", path)
            answer = connection.getresponse()
            return answer.status, answer.read()

    def json(self, path: str) -> Any:
        """Return what the API gives."""
        return json.loads(self.get(path)[1])

    def send(self, name: str, content: bytes, fields: Mapping[str, str]) -> tuple[int, Any]:
        """Upload a recording; return the status and the answer."""
        kind, body = form(name, content, fields)
        with contextlib.closing(self.connection()) as connection:
            connection.request("POST", "/api/v1/recordings", body, {"Content-Type": kind})
            answer = connection.getresponse()
            text = answer.read()
            return answer.status, json.loads(text) if text.startswith(b"{") else text


@dataclass
class Server(Client):
    """A running server."""

    process: "subprocess.Popen[str]"

    def kill(self) -> None:
        """Kill it as a loss of power would."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def memory(self) -> float:
        """Return the resident memory of the server and its processes [MiB]."""
        return sum(map(_resident, family(self.process.pid))) / 1024

    def processor_seconds(self) -> float:
        """Return the processor time of the server, without the processes that it has started [s]."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def serving(file: Path, *options: str) -> Iterator[Server]:
    """Yield a server of the history in `file`, ended with the block."""
    server = start(file, *options)
    try:
        yield server
    finally:
        server.process.terminate()
        try:
            server.process.wait(30)
        except subprocess.TimeoutExpired:
            server.kill()


def start(file: Path, *options: str) -> Server:
    """Return a server of the history in `file`."""
    return started([sys.executable, "-m", "emaphm.cli"], file, *options)


def started(program: list[str], file: Path, *options: str) -> Server:
    """Return a server of the history in `file`, begun in its folder by `program`, in a group of its own."""
    path = os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [*program, "serve", "--db", str(file), "--port", "0", "--json", *options],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
        cwd=file.parent,
        start_new_session=True,
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line:
        raise SystemExit("the server did not start")
    return Server(address(line), process)


def address(line: str) -> str:
    """Return where a server is that prints this when it answers."""
    return str(urlsplit(json.loads(line)["url"]).netloc)


def form(name: str, content: bytes, fields: Mapping[str, str]) -> tuple[str, bytes]:
    """Return the type and the body of a form with a file."""
    boundary = uuid.uuid4().hex
    parts = [
        f'--{boundary}\r\nContent-Disposition: form-data; name="{key}"\r\n\r\n{value}\r\n'.encode()
        for key, value in fields.items()
    ]
    head = f'--{boundary}\r\nContent-Disposition: form-data; name="recording"; filename="{name}"\r\n'
    parts.append(f"{head}Content-Type: application/octet-stream\r\n\r\n".encode() + content)
    parts.append(f"\r\n--{boundary}--\r\n".encode())
    return f"multipart/form-data; boundary={boundary}", b"".join(parts)


def over(server: Client, job: int) -> dict[str, Any]:
    """Return a job when nothing more will be done of it."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        found: dict[str, Any] = server.json(f"/api/v1/jobs/{job}")
        if found["state"] not in {"waiting", "running"}:
            return found
        time.sleep(0.1)
    raise SystemExit(f"upload {job} is not over after {PATIENCE_S:g} s")


def family(process: int) -> list[int]:
    """Return a process and those that it has started."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                parents.setdefault(int(fields[1]), []).append(int(entry.name))
    found, new = [process], [process]
    while new:
        new = [child for parent in new for child in parents.get(parent, [])]
        found += new
    return found


def _resident(process: int) -> int:
    """Return the resident memory of a process [KiB]."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{process}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1])
    return 0
