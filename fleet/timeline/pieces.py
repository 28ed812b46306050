"""Which file a recorder writes to, from one to the next; and none while the disk has no room.

Rerun's writer ends at the first thing that it cannot write: the file is torn there, and no reader
opens it. So a file is closed while there is room for what belongs to its end, and one that was torn
all the same is cut to what was written before.
"""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import rerun as rr

from fleet.timeline.drawing.sink import open_stream
from fleet.timeline.errors import UnwritableRecording
from fleet.timeline.recorder import Recorder
from fleet.timeline.rolling import Rolling, RollingFiles
from keyexpr_schema.full_disk import FullDisk

RESERVE_BYTES = 16 * 2**20
"""So much room is left to others; on a small disk an eighth of it."""


class Pieces:
    """The files of a recording that is named by `out`: `out` itself, and what follows it, or those
    of `rolling`.

    `say` hears where it is recorded to from now on, and why not. `tell` is that of `FullDisk`.
    """

    def __init__(
        self,
        out: Path,
        name: str,
        rolling: Rolling | None,
        say: Callable[[str], None],
        tell: Callable[[str | None], None],
    ) -> None:
        self._files = RollingFiles(out, rolling or Rolling())
        taken = out.is_file() and out.stat().st_size > 0
        self.begins_with = self._files.next() if rolling is not None or taken else out
        """The first file, which writes over no other."""
        self._name, self._say = name, say
        self._disk = FullDisk(out.parent, "the recorder", "nothing is recorded", tell)
        self._closed = False
        self._whole_bytes = 0

    def first(self, live_port: int | None = None) -> rr.RecordingStream:
        """The first file, which is also served on a port, if one is given.

        Raises:
            UnwritableRecording: it cannot be made, or there is no room for it.
        """
        first = self.begins_with
        if not _room(first, 1):
            raise UnwritableRecording(
                f"cannot record to {first}: less than {_reserve(first) / 2**20:.3g} MB are free "
                "there; free some, or name a file on another disk"
            )
        stream = open_stream(first, self._name, live_port)
        self._files.current = first
        self._files.drop_oldest()
        return stream

    def flush(self, recorder: Recorder, whole: bool) -> None:
        """Have what waits written: to the next file if it is time for that, to none without
        room."""
        try:
            self._go_on(recorder)
            recorder.flush(whole)
        except UnwritableRecording:
            self._cut()
        else:
            self._note_size()

    def close(self, recorder: Recorder) -> None:
        """Have the rest written."""
        try:
            recorder.close()
        except UnwritableRecording:
            self._cut()

    def _note_size(self) -> None:
        if not self._closed and self._files.current is not None:
            self._whole_bytes = self._files.current.stat().st_size

    def _cut(self) -> None:
        """The current file was torn."""
        assert self._files.current is not None
        os.truncate(self._files.current, self._whole_bytes)
        self._close()

    def _close(self) -> None:
        self._closed = True
        self._disk.found(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))

    def _go_on(self, recorder: Recorder) -> None:
        current = self._files.current
        assert current is not None
        if self._closed:
            if _room(current, 2):
                self._continue(recorder, current)
        elif not _room(current, 1):
            recorder.close()
            self._close()
        elif self._files.due():
            self._continue(recorder, current)

    def _continue(self, recorder: Recorder, before: Path) -> None:
        path = self._files.next()
        try:
            stream = open_stream(path, self._name)
        except UnwritableRecording as error:
            if not self._closed:
                self._say(f"{error}; recording goes on in {before}")
            self._files.stay(before)
            return
        recorder.continue_in(stream)
        self._closed, self._whole_bytes = False, 0
        self._disk.over()
        self._files.drop_oldest()
        self._say(f"recording to {path}")


def _room(file: Path, times: int) -> bool:
    """Whether there is room for so many times the reserve."""
    return shutil.disk_usage(_folder(file)).free >= times * _reserve(file)


def _reserve(file: Path) -> float:
    return min(RESERVE_BYTES, shutil.disk_usage(_folder(file)).total / 8)


def _folder(file: Path) -> Path:
    """The folder of a file; that in which it would be made, where there is none yet."""
    return next(folder for folder in file.absolute().parents if folder.is_dir())
