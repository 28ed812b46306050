"""The Rerun recorder: an observer of keys that nothing else of the fleet imports.

    from fleet.timeline import rows, save_screenshot, summary

Everything is imported when it is first asked for: rerun takes 0.6 s.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fleet.timeline.drawing.sink import open_stream as open_stream
    from fleet.timeline.errors import NoPicture as NoPicture
    from fleet.timeline.errors import TimelineError as TimelineError
    from fleet.timeline.errors import UnreadableRecording as UnreadableRecording
    from fleet.timeline.errors import UnwritableRecording as UnwritableRecording
    from fleet.timeline.process import run_recorder as run_recorder
    from fleet.timeline.reader import RecordingSummary as RecordingSummary
    from fleet.timeline.reader import Row as Row
    from fleet.timeline.reader import rows as rows
    from fleet.timeline.reader import summary as summary
    from fleet.timeline.recorder import Recorder as Recorder
    from fleet.timeline.screenshot import save_screenshot as save_screenshot

_NAMES = {
    "drawing.sink": "open_stream",
    "errors": "NoPicture TimelineError UnreadableRecording UnwritableRecording",
    "process": "run_recorder",
    "reader": "RecordingSummary Row rows summary",
    "recorder": "Recorder",
    "screenshot": "save_screenshot",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}
__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
