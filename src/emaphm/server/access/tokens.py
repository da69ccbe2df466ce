"""Access tokens, stored as hashes in a file that only its owner can read, and sessions of browsers."""

import hashlib
import hmac
import os
import secrets
import stat
import threading
import time
from pathlib import Path

from emaphm.errors import ServerError
from emaphm.input_files import exists, read_bytes
from emaphm.output_files import written_whole

TOKEN_BYTES = 32
"""Random bytes of a token: it cannot be guessed, so that a hash without salt suffices."""

MOST_BYTES = 2**20
"""Largest size of a file of tokens [bytes]."""

MOST_SESSIONS = 1000
"""Largest number of sessions at the same time; for a further session, the oldest is ended."""

LONGEST_NAME = 60


def add_token(path: Path, name: str) -> str:
    """Return a new token of `name`, whose hash is added to the file at `path`.

    Raises
    ------
    ServerError
        The name is not valid or already in the file, or the file cannot be used (`read_tokens`).
    """
    if not name or not name.isprintable() or " " in name or len(name) > LONGEST_NAME:
        raise ServerError(
            f"{name!r} is no name of a token; give up to {LONGEST_NAME} printable characters without a space"
        )
    known = read_tokens(path) if exists(path, ServerError) else {}
    if name in known.values():
        raise ServerError(
            f"{path}: has a token of '{name}' already; take its line out of the file, or give another name"
        )
    token = secrets.token_urlsafe(TOKEN_BYTES)
    lines = [f"{digest} {owner}" for digest, owner in {**known, _digest(token): name}.items()]
    with written_whole(path) as temporary:
        temporary.touch(mode=0o600)
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return token


def read_tokens(path: Path) -> dict[str, str]:
    """Return the names of the tokens in a file by their SHA-256.

    Raises
    ------
    ServerError
        The file is missing, other users can read or write it, or it is no file of tokens.
    """
    if not exists(path, ServerError):
        raise ServerError(f"{path}: no such file; make it with --tokens {path} --add-token NAME")
    content = read_bytes(path, MOST_BYTES, ServerError)
    status = path.stat()
    if stat.S_IMODE(status.st_mode) & 0o077:
        raise ServerError(
            f"{path}: other users can read this file of tokens; take that from them: chmod 600 {path}"
        )
    if status.st_uid not in {os.geteuid(), 0}:
        raise ServerError(f"{path}: belongs to another user; make a file of your own with --add-token")
    tokens = {}
    for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), start=1):
        digest, _, name = line.partition(" ")
        if len(digest) != 2 * hashlib.sha256().digest_size or not name:
            raise ServerError(
                f"{path}, line {number}: is no hash and name of a token; make the file with --add-token"
            )
        tokens[digest] = name
    if not tokens:
        raise ServerError(f"{path}: holds no token; add one with --add-token NAME")
    return tokens


class Doorkeeper:
    """Authorisation by a token, or by the session of a browser that has sent a token."""

    def __init__(self, tokens: dict[str, str], session_hours: float) -> None:
        self._tokens = tokens
        self._lasts_s = 3600 * session_hours
        self._sessions: dict[str, float] = {}
        self._lock = threading.Lock()

    def accepts(self, token: str) -> bool:
        """Return whether `token` is valid."""
        digest = _digest(token)
        return any(hmac.compare_digest(digest, known) for known in self._tokens)

    def session(self) -> str:
        """Return the key of a new session."""
        key = secrets.token_urlsafe(TOKEN_BYTES)
        with self._lock:
            now = time.monotonic()
            self._sessions = {digest: end for digest, end in self._sessions.items() if end > now}
            while len(self._sessions) >= MOST_SESSIONS:
                del self._sessions[next(iter(self._sessions))]
            self._sessions[_digest(key)] = now + self._lasts_s
        return key

    def knows(self, session: str) -> bool:
        """Return whether `session` is the key of a session that has not ended."""
        return self._sessions.get(_digest(session), 0.0) > time.monotonic()

    def end(self, session: str) -> None:
        """End a session."""
        with self._lock:
            self._sessions.pop(_digest(session), None)


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "replace")).hexdigest()
