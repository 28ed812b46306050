"""Where rows go: one Rerun stream, two timelines."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import rerun as rr
import rerun_bindings

from fleet.timeline.clock import Clock
from fleet.timeline.drawing.text import drawable
from fleet.timeline.errors import UnwritableRecording
from keyexpr_schema.private_files import private_file, private_folder

APPLICATION = "robotfleet"
SIM_TIME = "sim_time"
WALL_TIME = "wall_time"


FARTHEST_S = 9e9
"""Rerun counts nanoseconds in 64 bits: what says that it is of a later time [s] is drawn there."""
ROWS = 400
"""Rows of one entity that are sent at once, at the latest."""


@dataclass
class _Rows:
    """Rows of one archetype of one entity that wait to be sent."""

    fields: dict[str, list[Any]]
    sim_s: list[float] = field(default_factory=list)
    wall_s: list[float] = field(default_factory=list)


class Sink:
    """Logs to a Rerun stream on `sim_time` (duration) and `wall_time` (timestamp)."""

    def __init__(self, stream: rr.RecordingStream, clock: Clock) -> None:
        self.stream = stream
        self.clock = clock
        self._waiting: dict[tuple[str, Any], _Rows] = {}
        self.begun: tuple[float, float] | None = None
        """The earliest fleet time and wall time [s] of any row."""
        self.calls = 0
        """How often something was handed to Rerun: what it costs goes with these, not with rows."""

    def row(self, path: str, kind: Any, sim_s: float, wall_s: float | None, **fields: Any) -> None:
        """A row of an archetype at a fleet time [s]; it goes out with others at the next flush.

        Of an entity and archetype the fields are always the same. A field is one value, or a list
        with one for each instance; then all are, and of the same length.
        """
        rows = self._waiting.get((path, kind))
        if rows is None:
            rows = self._waiting[path, kind] = _Rows({name: [] for name in fields})
        if wall_s is None:
            wall_s = self.clock.wall_at(sim_s)
        sim_s, wall_s = countable(sim_s), countable(time.time() if wall_s is None else wall_s)
        self._begins(sim_s, wall_s)
        rows.sim_s.append(sim_s)
        rows.wall_s.append(wall_s)
        for name, value in fields.items():
            rows.fields[name].append(value)
        if len(rows.sim_s) >= ROWS:
            self._send(path, kind, self._waiting.pop((path, kind)))

    def flush(self) -> None:
        """Send the rows that wait."""
        waiting, self._waiting = self._waiting, {}
        for (path, kind), rows in waiting.items():
            self._send(path, kind, rows)

    def _send(self, path: str, kind: Any, rows: _Rows) -> None:
        first = next(iter(rows.fields.values()))
        if isinstance(first[0], list):
            flat = {name: list(chain(*values)) for name, values in rows.fields.items()}
            columns = kind.columns(**flat).partition([len(value) for value in first])
        else:
            columns = kind.columns(**rows.fields)
        self.columns(path, rows.sim_s, rows.wall_s, columns)

    def log(
        self, path: str, what: Any, sim_s: float, wall_s: float | None = None, *more: Any
    ) -> None:
        """Log archetypes at a fleet time [s]; the wall time follows from it if not given.

        It counts as later than the rows that wait, of what is below `path` as well.
        """
        for name in [name for name in self._waiting if f"{name[0]}/".startswith(f"{path}/")]:
            self._send(*name, self._waiting.pop(name))
        self.calls += 1
        if wall_s is None:
            wall_s = self.clock.wall_at(sim_s)
        sim_s, wall_s = countable(sim_s), countable(time.time() if wall_s is None else wall_s)
        self._begins(sim_s, wall_s)
        self.stream.set_time(SIM_TIME, duration=sim_s)
        self.stream.set_time(WALL_TIME, timestamp=wall_s)
        self.stream.log(path, what, *more)

    def _begins(self, sim_s: float, wall_s: float) -> None:
        if self.begun is None:
            self.begun = sim_s, wall_s
        elif sim_s < self.begun[0] or wall_s < self.begun[1]:
            self.begun = min(sim_s, self.begun[0]), min(wall_s, self.begun[1])

    def fix(self, path: str, what: Any) -> None:
        """Log an archetype that holds at all times."""
        self.calls += 1
        self.stream.log(path, what, static=True)

    def columns(
        self, path: str, sim_s: Sequence[float], wall_s: Sequence[float], columns: Any
    ) -> None:
        """Log many rows of one entity at once."""
        self.calls += 1
        sim_s, wall_s = [countable(each) for each in sim_s], [countable(each) for each in wall_s]
        self._begins(min(sim_s), min(wall_s))
        self.stream.send_columns(
            path,
            indexes=[
                rr.TimeColumn(SIM_TIME, duration=np.asarray(sim_s, dtype=np.float64)),
                rr.TimeColumn(WALL_TIME, timestamp=np.asarray(wall_s, dtype=np.float64)),
            ],
            columns=columns,
        )


def countable(time_s: float) -> float:
    """The time, or the farthest from 0 that a recording can have."""
    return max(-FARTHEST_S, min(FARTHEST_S, time_s))


def entity(*parts: str) -> str:
    """An entity path whose parts may hold any character: a `/` in a name makes no new level."""
    return str(rr.new_entity_path(list(parts)))


def open_stream(out: Path, name: str, live_port: int | None = None) -> rr.RecordingStream:
    """A new recording that is written to `out`, and served on `127.0.0.1:live_port` if given.

    The file has no table of contents at its end: Rerun keeps that in memory until the file is
    closed, some kB for each piece of it. Readers and viewer read the pieces themselves, as they do
    after a SIGKILL; `rerun rrd optimize` adds one.

    Raises:
        UnwritableRecording: the file cannot be made there, or begun.
    """
    try:
        if not out.parent.exists():
            private_folder(out.parent)
        private_file(out)
    except OSError as error:
        raise UnwritableRecording(
            f"cannot record to {out}: {error.strerror or error}; name a file you may write"
        ) from None
    stream = rr.RecordingStream(APPLICATION, recording_id=uuid4(), send_properties=True)
    sinks: list[Any] = [rr.FileSink(out, write_footer=False)]
    if live_port is not None:
        sinks.append(rr.GrpcServerSink(bind_ip="127.0.0.1", port=live_port))
    try:
        stream.set_sinks(*sinks)
    except RuntimeError as error:  # as where its beginning has no room
        raise UnwritableRecording(
            f"cannot record to {out}: {error}; free some room there, or name a file on another disk"
        ) from None
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    stream.send_recording_name(drawable(name))
    return stream


_broken: list[rr.RecordingStream] = []
"""Streams that could not write something: they are kept, for Rerun would wait for them to end."""


def give_up(stream: rr.RecordingStream) -> None:
    """Leave a stream alone whose writer has ended."""
    _broken.append(stream)


def any_given_up() -> bool:
    """Whether Rerun would wait for one at the end of the process."""
    return bool(_broken)


def end_unused_streams() -> None:
    """Let Rerun end the threads of streams that nobody refers to, which it does not by itself."""
    if not _broken:
        rerun_bindings.flush_and_cleanup_orphaned_recordings()
