"""A free port stays free for those who are told of it, and for nobody else."""

from __future__ import annotations

import socket
import sys

import pytest

from fleet.service.router_process import with_port
from keyexpr_schema.free_port import free_port


def listened(port: int, host: str = "127.0.0.1") -> None:
    """Listen on it, be connected with, and stop, as a server does that was told of the port."""
    with socket.create_server((host, port)), socket.create_connection((host, port)):
        pass


def test_who_is_told_of_it_can_listen_there_again_and_again() -> None:
    port = free_port()
    for _ in range(3):
        listened(port)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a port cannot be kept")
def test_nobody_else_is_given_it() -> None:
    """What takes ports that it is given does not say that it would share one."""
    port = free_port()
    with socket.socket() as other, pytest.raises(OSError, match="Address already in use"):
        other.bind(("127.0.0.1", port))


def test_an_endpoint_gets_a_port_of_its_own_address() -> None:
    assert with_port("tcp/127.0.0.1:7447") == "tcp/127.0.0.1:7447"
    endpoints = [with_port("tls/127.0.0.1:0") for _ in range(2)]
    ports = [int(endpoint.removeprefix("tls/127.0.0.1:")) for endpoint in endpoints]
    assert len(set(ports)) == 2
    for port in ports:
        listened(port)
