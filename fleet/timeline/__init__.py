"""The Rerun recorder: an observer of keys that nothing else of the fleet imports.

from fleet.timeline import rows, save_screenshot, summary
"""

from typing import TYPE_CHECKING

from keyexpr_schema.lazy import lazy_names

if TYPE_CHECKING:
    from fleet.timeline.drawing.sink import *  # noqa: F403
    from fleet.timeline.errors import *  # noqa: F403
    from fleet.timeline.process import *  # noqa: F403
    from fleet.timeline.reader import *  # noqa: F403
    from fleet.timeline.recorder import *  # noqa: F403
    from fleet.timeline.rolling import *  # noqa: F403
    from fleet.timeline.screenshot import *  # noqa: F403
else:
    __all__, __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "drawing.sink": "open_stream",
            "errors": "NoPicture TimelineError UnreadableRecording UnwritableRecording",
            "process": "run_recorder",
            "reader": "RecordingSummary Row rows summary",
            "recorder": "Recorder",
            "rolling": "BadRolling Rolling parse_rolling",
            "screenshot": "save_screenshot",
        },
    )
