"""A free port is kept for whoever is to listen on it."""

from __future__ import annotations

import socket
import sys

import pytest

from keyexpr_schema.free_ports import KEPT, free_port


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing is kept")
@pytest.mark.parametrize(
    ("host", "family"), [("127.0.0.1", socket.AF_INET), ("::1", socket.AF_INET6)]
)
def test_a_port_is_kept_for_a_server_and_from_all_others(host: str, family: int) -> None:
    try:
        port = free_port(host)
    except OSError:
        pytest.skip(f"this machine has no {host}")
    with socket.socket(family) as other, pytest.raises(OSError, match="in use"):
        other.bind((host, port))
    for _ in range(2):  # once more after it has ended
        with socket.create_server((host, port), family=family):
            pass
    assert port not in {free_port(host) for _ in range(KEPT - 1)}
