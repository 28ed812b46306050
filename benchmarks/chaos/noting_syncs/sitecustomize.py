"""In a process of the chaos run: notes how long a file was when it was last synced.

`fdatasync` is what the store and the planner's journal confirm with (`fleet/stores/synced_log.py`).
A power cut takes back what came after that; see `benchmarks.chaos.power`.
"""

import os
from pathlib import Path

_sync = os.fdatasync


def _noting(fd: int) -> None:
    length = os.fstat(fd).st_size  # what is written meanwhile need not be on the disk
    _sync(fd)
    path = Path(f"/proc/self/fd/{fd}").readlink()
    Path(f"{path}.synced-to").write_text(str(length), encoding="utf-8")


os.fdatasync = _noting  # type: ignore[assignment]
