"""What the long-lived processes of a fleet have in common when robotctl starts them."""

from __future__ import annotations

import os
import signal
import sys
import threading

END_WITH_STDIN = "ROBOTFLEET_END_WITH_STDIN"
"""Set by `robotctl demo` for its children: end when stdin ends, that is, when the parent died."""


def end_with_parent() -> None:
    """If a demo started this process, give it SIGTERM when the demo is gone, however it went."""
    if not os.environ.get(END_WITH_STDIN):
        return
    stdin = sys.stdin.fileno()

    def wait() -> None:
        while os.read(stdin, 4096):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, name="end-with-parent", daemon=True).start()
