"""Where the processes of a fleet keep what must last, where nobody says otherwise."""

from __future__ import annotations

import os
from pathlib import Path


def data_folder(given: Path | None, name: str, realm: str = "") -> Path:
    """Where a process keeps what must last: `given`, else a folder of its own.

    A store serves several realms. What a planner or a worker remembers is of one: in another it
    would carry on with plans that nobody made there.
    """
    if given is not None:
        return given
    home = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(home) / "robotfleet" / realm / name
