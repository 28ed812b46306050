"""Endpoints that can never be are told before anybody waits for them."""

from __future__ import annotations

import pytest

from keyexpr_schema.endpoints import check_endpoints, host_of
from keyexpr_schema.errors import BadEndpoint, Unreachable
from keyexpr_schema.transport.session import SessionConfig


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/127.0.0.1:7447",
        "tls/[::1]:3",
        "tls/router.example.org:7447#root_ca_certificate_file=/etc/ca.pem",
        "quic/first-host:65535?prio=1-3",
        "ws/my_router:80",
        "unixsock-stream//run/fleet.sock",
        "vsock/1:2",
    ],
)
def test_endpoints_of_zenoh(endpoint: str) -> None:
    check_endpoints([endpoint])
    assert SessionConfig((endpoint,)).endpoints == (endpoint,)


@pytest.mark.parametrize(
    ("endpoint", "wrong"),
    [
        (
            "localhost",
            "it must begin with a protocol and a slash; they look like 'tcp/127",
        ),
        (
            "http/127.0.0.1:7447",
            "'http' is none of its protocols, which are tcp, tls, quic",
        ),
        ("http://127.0.0.1:7447", "'http:' is none of its protocols"),
        ("TCP/127.0.0.1:7447", "'TCP' is none"),
        ("tcp/127.0.0.1", "it has no port; write tcp/127.0.0.1:7447"),
        ("tcp/127.0.0.1:", "it has no port; write tcp/127.0.0.1:7447"),
        ("tcp/[::1]", "it has no port"),
        ("tcp/127.0.0.1:99999", "its port '99999' must be a number from 1 to 65535"),
        ("tcp/127.0.0.1:x", "its port 'x' must be a number"),
        ("tcp/127.0.0.1:0", "its port must be a number from 1"),
        ("tcp/:7447", "it has no host; write tcp/127.0.0.1:7447"),
        ("tcp/300.1.1.1:1", "'300.1.1.1' is no internet address"),
        ("tcp/::1:7447", "'::1' is no name of a host"),
        ("tcp/a b:1", "'a b' is no name of a host"),
        ("tcp/caf\udce9:1", "is no name of a host"),
        ("unixsock-stream/", "there must be something behind"),
    ],
)
def test_what_is_none_is_told_with_what_would_be_right(endpoint: str, wrong: str) -> None:
    with pytest.raises(BadEndpoint) as refused:
        SessionConfig((endpoint,))
    assert wrong in str(refused.value)


def test_a_router_may_leave_its_port_to_the_system() -> None:
    check_endpoints(["tcp/127.0.0.1:0", "tcp/[::]:0"], listens=True)
    with pytest.raises(BadEndpoint, match=r"write tcp/0\.0\.0\.0:7447"):
        check_endpoints(["tcp/:7447"], listens=True)


def test_hosts_that_nobody_knows_are_named() -> None:
    assert [host_of(e) for e in ("tcp/a.b:1", "tcp/[::1]:1", "tcp/10.0.0.1:1", "vsock/1:2")] == [
        "a.b", None, None, None
    ]  # fmt: skip
    said = str(Unreachable.no_router(["tcp/a.b:1"], unknown=["a.b"]))
    assert said.startswith(
        "no router answers at tcp/a.b:1 (a.b: no host of that name is known here)"
    )
