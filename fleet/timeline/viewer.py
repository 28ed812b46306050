"""Rerun's viewer program: where it is, starting it, ending it."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from fleet.timeline.errors import NoPicture


def program() -> Path:
    """Rerun's viewer itself.

    Not `bin/rerun`: that is a wrapper, and ending it leaves the viewer running.

    Raises:
        NoPicture: it is not installed.
    """
    spec = find_spec("rerun_cli")
    if spec is not None and spec.submodule_search_locations:
        name = "rerun.exe" if sys.platform == "win32" else "rerun"
        for folder in spec.submodule_search_locations:
            found = Path(folder) / name
            if found.is_file():
                return found
    raise NoPicture("Rerun's viewer is not installed: pip install rerun-sdk brings it")


def has_screen() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def start(arguments: list[str], output: int = subprocess.DEVNULL) -> subprocess.Popen[bytes]:
    """Start the viewer, bound to this machine only.

    Raises:
        NoPicture: it is not installed, or cannot be started.
    """
    command = [str(program()), "--bind", "127.0.0.1", *arguments]
    try:
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            # What it logs it also shows, as a note over the picture.
            env={**os.environ, "RUST_LOG": "error"},
        )
    except OSError as error:
        raise NoPicture(f"Rerun's viewer cannot be started: {error.strerror or error}") from None


def end(viewer: subprocess.Popen[bytes], patience_s: float = 5.0) -> None:
    """End a viewer that `start` started."""
    if viewer.poll() is not None:
        return
    viewer.terminate()
    try:
        viewer.wait(patience_s)
    except subprocess.TimeoutExpired:
        viewer.kill()
        viewer.wait()
