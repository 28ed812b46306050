"""Free TCP ports of this machine, kept for whoever is to listen there."""

from __future__ import annotations

import atexit
import socket
import sys
from collections import deque

KEPT = 64
"""So many ports are kept, the latest ones."""

_kept: deque[socket.socket] = deque()


def free_port(host: str = "127.0.0.1") -> int:
    """A port of `host` on which nobody listens; the system gives it to nobody else as a free one
    while this process runs, also where who listens on it ends and begins again.

    A socket keeps it that is bound and does not listen. That is in nobody's way who listens with
    `SO_REUSEADDR`, as servers do, on Linux; elsewhere nothing is kept.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    bound = socket.socket(family)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind((host, 0))
        port = int(bound.getsockname()[1])
    except BaseException:
        bound.close()
        raise
    _kept.append(bound)
    while len(_kept) > (KEPT if sys.platform == "linux" else 0):
        _kept.popleft().close()
    return port


@atexit.register
def _let_go() -> None:
    while _kept:
        _kept.popleft().close()
