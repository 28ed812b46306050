"""Recordings that roll: `missions-0001.rrd`, `missions-0002.rrd`, …, each complete in itself."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fleet.timeline.errors import TimelineError

_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "MB": 2.0**20, "GB": 2.0**30}
_EVERY = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h|MB|GB)")


RETRY_S = 60.0
"""So long after a file could not be made it is tried again."""


class BadRolling(TimelineError):
    """What was said about when to begin a new file cannot be meant."""


@dataclass(frozen=True)
class Rolling:
    """A new file is begun after `seconds`, or beyond `size_bytes`, or never by itself; the latest
    `keep` stay, or all."""

    seconds: float | None = None
    size_bytes: float | None = None
    keep: int | None = None


def parse_rolling(every: str, keep: int | None = None) -> Rolling:
    """What `90s`, `30min`, `2h`, `500MB` or `2GB` means; the latest `keep` files stay, or all.

    Raises:
        BadRolling: it is none of these, or none is kept.
    """
    if keep is not None and keep < 1:
        raise BadRolling(f"{keep} files cannot be kept; keep at least 1")
    found = _EVERY.fullmatch(every.strip())
    amount = float(found[1]) * _UNITS[found[2]] if found else 0.0
    if found is None or amount <= 0.0:
        raise BadRolling(
            f"{every!r} is no time and no size; say e.g. 30min, 2h, 500MB or 2GB, above 0"
        )
    if found[2] in ("s", "min", "h"):
        return Rolling(seconds=amount, keep=keep)
    return Rolling(size_bytes=amount, keep=keep)


class RollingFiles:
    """The files beside `out`, which names them: those of earlier runs are counted on.

    `now` gives seconds of any clock that never goes back.
    """

    def __init__(
        self, out: Path, rolling: Rolling, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._out, self._rolling, self._now = out, rolling, now
        self._begun_s = now()
        self._blocked_until_s = self._begun_s
        self.current: Path | None = None

    def due(self) -> bool:
        """Whether the current file is old or large enough."""
        if self.current is None:
            return True
        if self._now() < self._blocked_until_s:
            return False
        seconds, size_bytes = self._rolling.seconds, self._rolling.size_bytes
        if seconds is not None and self._now() - self._begun_s >= seconds:
            return True
        return size_bytes is not None and _size(self.current) >= size_bytes

    def next(self) -> Path:
        """The name of the next file, which is the current one from now on."""
        number = max(self._numbered(), default=0) + 1
        self._begun_s = self._now()
        self.current = self._out.with_name(f"{self._out.stem}-{number:04d}{self._out.suffix}")
        return self.current

    def stay(self, path: Path | None) -> None:
        """The next file could not be made: this one stays current, and is due later again."""
        self.current, self._blocked_until_s = path, self._now() + RETRY_S

    def drop_oldest(self) -> None:
        """Delete the oldest files where there are more than are kept; never the current one."""
        if self._rolling.keep is None:
            return
        numbered = self._numbered()
        for number in sorted(numbered)[: -self._rolling.keep]:
            if numbered[number] != self.current:
                numbered[number].unlink(missing_ok=True)

    def _numbered(self) -> dict[int, Path]:
        name = re.compile(
            rf"{re.escape(self._out.stem)}-(\d{{4,}}){re.escape(self._out.suffix)}", re.ASCII
        )
        if not self._out.parent.is_dir():
            return {}
        found = ((name.fullmatch(path.name), path) for path in self._out.parent.iterdir())
        return {int(match[1]): path for match, path in found if match is not None}


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
