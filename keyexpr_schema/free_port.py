"""A free TCP port that stays ours.

Who asks the system for a free port and lets it go again may find it taken a moment later: the
system gives it to the next who asks, and to any program as its own end of a connection. That is so
while a router starts, and each time that it is started again.
"""

from __future__ import annotations

import socket
import sys

_kept: list[int] = []
"""Files that hold the ports, for as long as this process runs."""


def free_port(host: str = "127.0.0.1") -> int:
    """A TCP port on which nobody listens, and which the system gives to nobody while we run.

    It stays bound here, by a socket that never listens, and whoever is told of it can listen there
    as often as they like: on Linux two sockets may have one port when both say `SO_REUSEADDR`, as
    those that listen do, and one of them listens at most. Elsewhere the port is only free now.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as holder:
        holder.bind((host, 0))
        port = int(holder.getsockname()[1])
        if sys.platform == "linux":
            # Only now: the system gives out no port that somebody has without that.
            holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            _kept.append(holder.detach())
        return port
