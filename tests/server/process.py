"""`emaphm serve` in a separate process, as a user starts it, with its memory and processor time."""

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
    """Client of a server at an address."""

    address: str

    def connection(self, timeout: float = 60.0) -> http.client.HTTPConnection:
        """Return a connection to the server."""
        return http.client.HTTPConnection(self.address, timeout=timeout)

    def get(self, path: str) -> tuple[int, bytes]:
        """Return status and body of a page."""
        with contextlib.closing(self.connection()) as connection:
            connection.request("GET", path)
            answer = connection.getresponse()
            return answer.status, answer.read()

    def json(self, path: str) -> Any:
        """Return the JSON document at a path of the API."""
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
        """Kill the server without a chance to finish, as a loss of power does."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def memory(self) -> float:
        """Return the resident memory of the server and its processes [MiB]."""
        return sum(map(_resident, family(self.process.pid))) / 1024

    def processor_seconds(self) -> float:
        """Return the processor time of the server without its child processes [s]."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def serving(file: Path, *options: str) -> Iterator[Server]:
    """Yield a server of the history in `file`, which is ended with the block."""
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
    """Return a server of the history in `file`, started by `program` there, in a new process group."""
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
    """Return the address of a server from the line that it prints when it is ready."""
    return str(urlsplit(json.loads(line)["url"]).netloc)


def form(name: str, content: bytes, fields: Mapping[str, str]) -> tuple[str, bytes]:
    """Return the content type and the body of a form with a file."""
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
    """Wait until a job has ended, and return its JSON document."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        document: dict[str, Any] = server.json(f"/api/v1/jobs/{job}")
        if document["state"] not in {"waiting", "running"}:
            return document
        time.sleep(0.1)
    raise SystemExit(f"upload {job} is not over after {PATIENCE_S:g} s")


def family(process: int) -> list[int]:
    """Return the ids of a process and of all its descendants."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
                parents.setdefault(int(fields[1]), []).append(int(entry.name))
    processes, generation = [process], [process]
    while generation:
        generation = [child for parent in generation for child in parents.get(parent, [])]
        processes += generation
    return processes


def _resident(process: int) -> int:
    """Return the resident memory of a process [KiB]."""
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{process}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1])
    return 0
