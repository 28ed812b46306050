"""Draws `status.svg`: `robotctl status` on a terminal, of twenty robots on a busy day.

    python docs/screenshots/status.py docs/screenshots/status.svg

The fleet is a real one, in a folder that is deleted afterwards.
"""

from __future__ import annotations

import fcntl
import io
import json
import os
import pty
import re
import shlex
import struct
import subprocess
import sys
import tempfile
import termios
import time
from pathlib import Path

from rich.console import Console
from rich.text import Text

WIDTH, HEIGHT = 120, 40
FONTS = "Menlo, Consolas, DejaVu Sans Mono,"
ROBOTCTL = [sys.executable, "-m", "cli.main"]
UP = "up warehouse --detach --backend kinematic --speed 8"
DAY = """
world add --object parcel_13 --kind parcel --label "parcel 13"
world add "Parcel 13 is in store b."
goal add "Bring parcel 13 to packing" --id express --plan --wait
goal add "Bring parcel 9 to packing" --id parcel-9
plan create --no-start
goal add "Bring parcel 10 to the table" --id parcel-10
goal add "Search the aisle every evening" --id evening-round
goal add "Bring parcel 1 to dispatch" --id parcel-1
goal add "Bring parcel 3 to dispatch" --id parcel-3
goal add "Bring parcel 5 to dispatch" --id parcel-5
goal add "Bring parcel 7 to dispatch" --id parcel-7
goal add "Bring parcel 2 to packing" --id parcel-2
goal add "Bring parcel 4 to packing" --id parcel-4
goal add "Bring parcel 6 to packing" --id parcel-6
goal add "Search dispatch" --id dispatch-round
drain picker_3 --why "a new battery" --as ben@lab
pause --robot scout_4 --why "visitors"
world close packing_door_2 --why "the floor is wet"
plan create
goal add "Bring parcel 11 to dispatch" --id parcel-11
"""
STOP = 'stop --robot picker_8 --robot scout_12 --why "a pallet has fallen"'
RUNS = "plan-3"
DONE = 6
"""So many tasks of that are done when the picture is taken."""


def run(line: str, env: dict[str, str], folder: str) -> str:
    """What a command prints, however it ends: some of the day goes wrong."""
    words = [*ROBOTCTL, *shlex.split(line)]
    return subprocess.run(words, env=env, cwd=folder, capture_output=True, text=True).stdout


def done(env: dict[str, str], folder: str) -> int:
    """How many tasks of the plan that runs are done."""
    tasks = json.loads(run(f"task list {RUNS} --json", env, folder))
    return sum(each["state"] == "succeeded" for each in tasks)


def on_a_terminal(line: str, env: dict[str, str], folder: str) -> str:
    """What a command prints on a terminal of WIDTH by HEIGHT, with its colours."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", HEIGHT, WIDTH, 0, 0))
    with subprocess.Popen(
        [*ROBOTCTL, *shlex.split(line)], env=env, cwd=folder, stdout=theirs
    ) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                some = os.read(ours, 65536)
            except OSError:  # how a terminal ends
                break
            shown += some
        process.wait()
    os.close(ours)
    return shown.decode()


def main() -> None:
    """Run the day, and draw what stands on the screen."""
    out = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        root = Path(__file__).parents[2]
        env = {k: v for k, v in os.environ.items() if k != "NO_COLOR" and "ROBOTFLEET" not in k}
        env |= {"HOME": folder, "PYTHONPATH": str(root), "TERM": "xterm-256color"}
        env |= {"ROBOTFLEET_AS": "ana@lab", "COLUMNS": str(WIDTH), "LINES": str(HEIGHT)}
        run(UP, env, folder)
        try:
            for line in DAY.strip().splitlines():
                run(line, env, folder)
            while done(env, folder) < DONE:
                time.sleep(0.1)
            run(STOP, env, folder)
            shown = on_a_terminal("status", env, folder)
        finally:
            run("down", env, folder)
    screen = Console(width=WIDTH, record=True, file=io.StringIO(), force_terminal=True)
    screen.print(Text("$ robotctl status"))
    screen.print(Text.from_ansi(shown.replace("\r\n", "\n")))
    drawn = screen.export_svg(title="robotctl status", unique_id="status")
    drawn = re.sub(r"@font-face \{[^}]*\}\s*", "", drawn)  # a picture in a page loads no font
    out.write_text(drawn.replace("Fira Code,", FONTS), encoding="utf-8")
    sys.stdout.write(shown)


if __name__ == "__main__":
    main()
