"""The Rerun recorder: an observer of keys that nothing else of the fleet imports.

from fleet.timeline import rows, save_screenshot, summary
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

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
else:
    __all__, __getattr__ = lazy_names(
        __name__,
        {
            "drawing.sink": "open_stream",
            "errors": "NoPicture TimelineError UnreadableRecording UnwritableRecording",
            "process": "run_recorder",
            "reader": "RecordingSummary Row rows summary",
            "recorder": "Recorder",
            "screenshot": "save_screenshot",
        },
    )
