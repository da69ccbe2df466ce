"""Runs the examples of the pages when the site is built, and shows what they print.

A `console` block holds commands, each after "$ "; a `python` block holds the next lines of the page's
script. They run in a folder of that page, which `examples.py` fills with recordings, descriptions and a
history. A command that fails is a warning, which the build takes for an error.
"""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.nodes import document, literal_block
from sphinx.application import Sphinx
from sphinx.util import logging

PROMPT = "$ "
SEPARATOR = "\x1e"
"""Between what two blocks of Python print."""

LONGEST_S = 300
"""A block that takes longer has no place in a page that is built [s]."""

MOST_LINES = 40
"""Of an answer; the rest is left out, and counted."""

log = logging.getLogger(__name__)


def execute(app: Sphinx, page: document) -> None:
    """Run the blocks of one page; each console block then shows commands and answers."""
    blocks = [b for b in page.findall(literal_block) if b.get("language") in ("console", "python", "toml")]
    if not blocks:
        return
    folder = Path(app.config.example_folders) / app.env.current_document.docname.replace("/", "-")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(app.config.example_files, folder)
    for block in blocks:
        if block["language"] == "console":
            _show(block, [_answered(line, folder, block) for line in _commands(block.astext())])
        elif block["language"] == "toml":
            tomllib.loads(block.astext())
    _run_scripts([block for block in blocks if block["language"] == "python"], folder)


def _run_scripts(blocks: list[literal_block], folder: Path) -> None:
    """Run the Python of a page as one script; what each block prints goes below it."""
    if not blocks:
        return
    script = f"\nprint({SEPARATOR!r}, end='')\n".join(block.astext() for block in blocks)
    printed = _run([sys.executable, "-c", script], folder, blocks[0]).split(SEPARATOR)
    for block, text in zip(blocks, printed, strict=False):
        if text.strip():
            answer = literal_block(text.rstrip(), text.rstrip(), language="text")
            block.parent.insert(block.parent.index(block) + 1, answer)


def _commands(text: str) -> list[str]:
    return [line.removeprefix(PROMPT) for line in text.splitlines() if line.startswith(PROMPT)]


def _answered(command: str, folder: Path, block: literal_block) -> str:
    return f"{PROMPT}{command}\n{_run(command, folder, block)}".rstrip()


def _run(command: str | list[str], folder: Path, block: literal_block) -> str:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    shell = isinstance(command, str)
    done = subprocess.run(  # noqa: S603 - the pages are ours
        command,
        shell=shell,
        executable=shutil.which("bash") if shell else None,
        cwd=folder,
        env={**os.environ, "PATH": path, "COLUMNS": "120", "MPLBACKEND": "agg"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LONGEST_S,
        check=False,
    )
    if done.returncode:
        log.warning("example fails (%d): %s\n%s", done.returncode, command, done.stdout, location=block)
    return done.stdout


def _show(block: literal_block, answers: list[str]) -> None:
    lines = "\n".join(answers).splitlines()
    if len(lines) > MOST_LINES:
        lines[MOST_LINES:] = [f"… ({len(lines) - MOST_LINES} more lines)"]
    block["force"] = True  # an answer need not look like a shell's
    block.rawsource = "\n".join(lines)
    block.children = [nodes.Text(block.rawsource)]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register with Sphinx."""
    app.add_config_value("example_files", "", "env", [str])
    app.add_config_value("example_folders", "", "env", [str])
    app.connect("doctree-read", execute)
    return {"version": "1", "parallel_read_safe": False}
