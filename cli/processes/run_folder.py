"""The folder of one run: a log for each process, stores and journals, the recording."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from cli.errors import BadArgument
from keyexpr_schema.private_files import private_folder

DATA, RECORDING, SUMMARY = "data", "recording.rrd", "summary.json"
RUNS = Path("runs")


def claim_run_folder(folder: Path) -> None:
    """Make `folder` the place of one run, and of no other, also of one that starts just now.

    Raises:
        BadArgument: another run lies, or begins, there.
    """
    claim_folder(folder)
    used = next((name for name in (RECORDING, SUMMARY) if (folder / name).is_file()), None)
    used = used or next((log.name for log in folder.glob("*.log")), None)
    if used is None:
        try:
            (folder / DATA).mkdir(mode=0o700)
        except FileExistsError:
            used = DATA
    if used is not None:
        raise BadArgument(
            f"{folder} has the {used} of another run, and two runs would mix in it; "
            "name a folder that is new, or remove that one first"
        )


def new_run_folder(mission: str, runs: Path = RUNS) -> Path:
    """A folder of its own, `runs/MISSION-TIME`, for a run that begins now: nobody else gets it."""
    if not runs.exists():
        claim_folder(runs)
    base, number = f"{mission}-{datetime.now():%Y%m%d-%H%M%S}", 2
    name = base
    while True:
        try:
            (runs / name).mkdir(mode=0o700)
        except FileExistsError:
            name, number = f"{base}-{number}", number + 1
        else:
            return runs / name


def claim_folder(folder: Path) -> None:
    """Make a folder that nobody else reads.

    Raises:
        BadArgument: it cannot be made, or is no place to keep something in.
    """
    try:
        private_folder(folder)
    except OSError as error:
        raise BadArgument(f"{folder} cannot be used: {error.strerror or error}") from None
