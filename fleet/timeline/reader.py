"""Reads a recording back: what is in it, and when."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fleet.timeline.drawing.sink import SIM_TIME
from fleet.timeline.errors import UnreadableRecording

_NANOSECONDS = 1e9


@dataclass
class EntitySummary:
    """One entity of a recording.

    `rows` counts logged rows, static ones not among them; `components` are named as Rerun names
    them, e.g. `Transform3D:translation`.
    """

    path: str
    rows: int = 0
    static: bool = False
    components: set[str] = field(default_factory=set)
    sim_span_s: tuple[float, float] | None = None


@dataclass(frozen=True)
class RecordingSummary:
    """What a recording holds. `sim_span_s` is the first and the last fleet time [s] in it."""

    path: Path
    size_bytes: int
    timelines: frozenset[str]
    entities: dict[str, EntitySummary]
    sim_span_s: tuple[float, float] | None

    @property
    def rows(self) -> int:
        """Rows of all entities, static ones not among them."""
        return sum(entity.rows for entity in self.entities.values())


@dataclass(frozen=True)
class Row:
    """One logged row of one component. `sim_s` is `None` where it is static."""

    sim_s: float | None
    value: Any


def summary(path: Path) -> RecordingSummary:
    """What the recording at `path` holds.

    Raises:
        UnreadableRecording: there is no such file, or it is not a recording.
    """
    entities: dict[str, EntitySummary] = {}
    timelines: set[str] = set()
    for chunk in _chunks(path):
        name = str(chunk.entity_path)
        one = entities.setdefault(name, EntitySummary(name))
        batch = chunk.to_record_batch()
        columns = set(batch.schema.names)
        mine = set(chunk.timeline_names)
        timelines |= mine
        one.components |= {c for c in columns - mine if "RowId" not in c}
        if chunk.is_static:
            one.static = True
            continue
        one.rows += batch.num_rows
        times = _sim_times(batch)
        if times:
            low, high = one.sim_span_s or (times[0], times[0])
            one.sim_span_s = (min(low, *times), max(high, *times))
    spans = [one.sim_span_s for one in entities.values() if one.sim_span_s is not None]
    span = (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else None
    return RecordingSummary(path, path.stat().st_size, frozenset(timelines), entities, span)


def rows(path: Path, entity: str, component: str) -> list[Row]:
    """Every row of one component of one entity, by fleet time, rows at the same time as logged.

    `component` may be the end of its name, e.g. `state` for `StateChange:state`. Values are lists,
    one item an instance.

    Raises:
        UnreadableRecording: there is no such file, or it is not a recording.
    """
    found: list[tuple[float, int, Row]] = []
    for number, chunk in enumerate(_chunks(path)):
        if str(chunk.entity_path) != entity:
            continue
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name != component and not name.endswith(f":{component}"):
                continue
            times = _sim_times(batch)
            for at, value in enumerate(batch.column(name).to_pylist()):
                if value is None:
                    continue
                sim_s = times[at] if times else None
                order = float("-inf") if sim_s is None else sim_s
                found.append((order, number, Row(sim_s, value)))
    found.sort(key=lambda item: item[:2])
    return [row for _, _, row in found]


def _sim_times(batch: Any) -> list[float]:
    if SIM_TIME not in batch.schema.names:
        return []
    column = batch.column(SIM_TIME).cast("int64")
    return [nanos / _NANOSECONDS for nanos in column.to_pylist()]


def _chunks(path: Path) -> Iterator[Any]:
    from rerun.chunk import RrdReader

    if not path.is_file():
        raise UnreadableRecording(f"there is no recording at {path}")
    try:
        with warnings.catch_warnings():
            # The recorder writes none; the rest is good.
            warnings.filterwarnings("ignore", message="RRD file has no footer")
            reader = RrdReader(path)
        yield from reader.stream()
    except (ValueError, RuntimeError, OSError) as error:
        raise UnreadableRecording(f"{path} is not a readable Rerun recording: {error}") from None
