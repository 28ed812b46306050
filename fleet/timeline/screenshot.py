"""A picture of a recording without a screen: `python -m fleet.timeline.screenshot REC OUT.png`."""

from __future__ import annotations

import argparse
import contextlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, TypeVar

from fleet.timeline import viewer
from fleet.timeline.drawing.sink import SIM_TIME
from fleet.timeline.errors import NoPicture, TimelineError
from fleet.timeline.reader import summary
from keyexpr_schema.free_ports import free_port
from keyexpr_schema.whole_files import make_folder, write_whole

T = TypeVar("T")
DRIVER = "mesa-vulkan-drivers"
"""The Debian package with a Vulkan driver that needs no graphics card."""

ANSWERS_S = 120.0
"""What a viewer may take to start, or to answer anything."""
NOTES_S = 8.0
"""So long after its start the viewer no longer shows notes over the picture."""
_NO_DRIVER = ("adapter", "render context", "vulkan", "wgpu")


def save_screenshot(
    recording: Path,
    out: Path,
    size: tuple[int, int] = (1600, 900),
    at_s: float | None = None,
    patience_s: float = 0.0,
) -> None:
    """Draw a recording as the viewer shows it, at fleet time `at_s` [s] (`None`: at its end).

    `size` is width and height in pixels. Takes some seconds without a graphics card, and at least
    `patience_s`: then nothing that the viewer says of itself hides a part of it.

    Raises:
        UnreadableRecording: there is no such recording.
        NoPicture: the viewer or a graphics driver is missing, or the picture cannot be written.
    """
    if at_s is None:
        span = summary(recording).sim_span_s
        at_s = span[1] if span else 0.0
    else:
        summary(recording)
    port = free_port()
    with tempfile.TemporaryFile() as output:
        shown = viewer.start(
            [
                "--headless",
                "--hide-welcome-screen",
                "--window-size",
                f"{size[0]}x{size[1]}",
                "--port",
                str(port),
            ],
            output=output.fileno(),
        )
        try:
            picture = _take(shown, output, port, recording, at_s, patience_s)
        finally:
            viewer.end(shown)
    try:
        make_folder(out.parent)
        write_whole(out, picture)
    except OSError as error:
        raise NoPicture(f"cannot write {out}: {error.strerror or error}") from None


def _take(
    shown: subprocess.Popen[bytes],
    output: IO[bytes],
    port: int,
    recording: Path,
    at_s: float,
    patience_s: float,
) -> bytes:
    from rerun.experimental import ViewerClient

    settled = time.monotonic() + patience_s
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    asked = _Patience(shown, output)
    client: Any = asked(lambda: _connected(ViewerClient, url))
    asked(lambda: client.open(str(recording.resolve())))
    asked(lambda: _loaded(client))
    asked(lambda: client.set_time(SIM_TIME, duration=at_s, play_state="paused"))
    # The first pictures still lack what is laid out from one frame to the next.
    picture, last = b"", None
    for _ in range(20):
        picture = asked(client.take_screenshot)
        if picture == last and time.monotonic() >= settled:
            break
        last = picture
        if time.monotonic() < settled:
            with contextlib.suppress(subprocess.TimeoutExpired):
                shown.wait(0.5)
    if not picture.startswith(b"\x89PNG"):
        raise NoPicture(f"Rerun's viewer gave no picture of {recording}")
    return picture


def _connected(client_type: Any, url: str) -> Any:
    client = client_type.connect(url)
    client.get_state()
    return client


def _loaded(client: Any) -> None:
    """Raises what is not loaded yet."""
    state = client.get_state()
    if state.loading or not state.recordings:
        raise RuntimeError("it still loads the recording")


class _Patience:
    """Asks a viewer until it answers: a client gives up after 15 s, and a busy machine that draws
    without a graphics card takes longer."""

    def __init__(self, shown: subprocess.Popen[bytes], output: IO[bytes]) -> None:
        self._shown, self._output = shown, output

    def __call__(self, ask: Callable[[], T]) -> T:
        """What `ask` returns once it raises nothing.

        Raises:
            NoPicture: the viewer has ended, or does not answer.
        """
        deadline = time.monotonic() + ANSWERS_S
        while True:
            try:
                return ask()
            except Exception as error:
                # The client raises whatever its transport does while the viewer starts or ends.
                trouble = error
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._shown.wait(0.2)
                raise NoPicture(_why(self._output))
            if time.monotonic() > deadline:
                raise NoPicture(
                    f"Rerun's viewer does not answer after {ANSWERS_S:.0f} s: {trouble}"
                )


def _why(output: IO[bytes]) -> str:
    output.seek(0)
    text = output.read().decode(errors="replace")
    if any(word in text.lower() for word in _NO_DRIVER):
        return (
            "Rerun's viewer finds no graphics driver: install one that draws in software "
            f"(on Debian and Ubuntu: apt-get install {DRIVER})"
        )
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    first = [line for line in lines if "panicked at" in line] or lines or ["it said nothing"]
    return f"Rerun's viewer ended at once: {first[0]}"


def main(arguments: list[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Draw a recording to a PNG, without a screen.")
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--at", type=float, help="fleet time in seconds (default: the end)")
    parser.add_argument("--size", default="1600x900", help="WIDTHxHEIGHT in pixels")
    options = parser.parse_args(arguments)
    width, _, height = options.size.partition("x")
    if not (width.isdigit() and height.isdigit()):
        parser.error(f"--size {options.size!r} is not WIDTHxHEIGHT, e.g. 1600x900")
    try:
        size = int(width), int(height)
        save_screenshot(options.recording, options.out, size, options.at, NOTES_S)
    except TimelineError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
