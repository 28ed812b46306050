"""Zenoh endpoints, checked before anybody waits for what can never be.

Zenoh itself takes any text with a slash in it, and then tries for ever.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Iterable

from keyexpr_schema.errors import BadEndpoint

EXAMPLE = "tcp/127.0.0.1:7447"
BY_PORT = ("tcp", "tls", "quic", "udp", "ws")
OVER_TCP = ("tcp", "tls", "ws")
BY_PATH = ("unixsock-stream", "unixpipe", "serial", "vsock")
_LABEL = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9_-]*[A-Za-z0-9_])?")
LAST_PORT = 65535


def check_endpoints(endpoints: Iterable[str], *, listens: bool = False) -> None:
    """That all of these can be Zenoh endpoints; one to listen on may leave its port to the system.

    Raises:
        BadEndpoint: one cannot; the sentence says what is wrong with it, and what would be right.
    """
    for endpoint in endpoints:
        if (wrong := _wrong(endpoint, listens)) is not None:
            raise BadEndpoint(f"{endpoint!r} is not a Zenoh endpoint: {wrong}")


def host_of(endpoint: str) -> str | None:
    """The name of the host in an endpoint; `None` if it names none, but an address or a path."""
    protocol, _, address = endpoint.partition("/")
    host = re.split("[?#]", address)[0].rpartition(":")[0]
    return host if protocol in BY_PORT and host and not _is_address(host) else None


def tcp_address(endpoint: str) -> tuple[str, int] | None:
    """Host and port of an endpoint over TCP; `None` if it is none."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = re.split("[?#]", address)[0].rpartition(":")
    if protocol not in OVER_TCP or not port.isdecimal():
        return None
    return host.strip("[]"), int(port)


def _wrong(endpoint: str, listens: bool) -> str | None:
    protocol, slash, address = endpoint.partition("/")
    if not slash:
        return f"it must begin with a protocol and a slash; they look like {EXAMPLE!r}"
    if protocol in BY_PATH:
        return None if address else f"there must be something behind {protocol}/"
    if protocol not in BY_PORT:
        known = ", ".join((*BY_PORT, *BY_PATH))
        return f"{protocol!r} is none of its protocols, which are {known}; such as {EXAMPLE!r}"
    host, colon, port = re.split("[?#]", address)[0].rpartition(":")
    if not colon or (not port and host) or port.endswith("]"):
        return f"it has no port; write {protocol}/{address.rstrip(':')}:7447"
    if not (port.isascii() and port.isdecimal()) or int(port) > LAST_PORT:
        return f"its port {port!r} must be a number from 1 to {LAST_PORT}"
    if int(port) == 0 and not listens:
        return f"its port must be a number from 1 to {LAST_PORT}"
    if not host:
        return f"it has no host; write {protocol}/{'0.0.0.0' if listens else '127.0.0.1'}:{port}"
    if _is_address(host):
        return None
    if re.fullmatch(r"[0-9.]+", host) or host.startswith("["):
        return f"{host!r} is no internet address"
    if len(host) > 253 or not all(_LABEL.fullmatch(label) for label in host.split(".")):
        return f"{host!r} is no name of a host"
    return None


def _is_address(host: str) -> bool:
    bare = host[1:-1] if host.startswith("[") and host.endswith("]") else host
    try:
        version = ipaddress.ip_address(bare).version
    except ValueError:
        return False
    return (version == 6) == (bare != host)
