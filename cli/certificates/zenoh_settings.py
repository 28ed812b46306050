"""The Zenoh configuration of somebody who has a certificate: TLS on both sides (mTLS)."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cli.certificates.identity import Identity, Kind

ACCESS = "access_control"


def zenoh_settings(
    identity: Identity,
    authority: Path,
    certificate: Path,
    key: Path,
    connect: Sequence[str] = (),
    listen: Sequence[str] = (),
    access_control: Mapping[str, Any] | None = None,
) -> str:
    """JSON5 for `--zenoh-config`; files are named relative to the folder that they are all in."""
    tls: dict[str, Any] = {
        "root_ca_certificate": authority.name,
        "connect_certificate": certificate.name,
        "connect_private_key": key.name,
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }
    if identity.kind is Kind.ROUTER:
        tls["listen_certificate"] = certificate.name
        tls["listen_private_key"] = key.name
    settings: dict[str, Any] = {"transport": {"link": {"tls": tls, "protocols": ["tls"]}}}
    if connect:
        mode = "router" if identity.kind is Kind.ROUTER else "client"
        settings["connect"] = {"endpoints": {mode: list(connect)}}
    if listen:
        settings["listen"] = {"endpoints": list(listen)}
    if access_control is not None:
        settings[ACCESS] = access_control
    return (
        f"// {identity}: made by `robotctl certs`, which writes it anew with each certificate.\n"
        f"{json.dumps(settings, indent=2)}\n"
    )


def with_access_control(text: str, access_control: Mapping[str, Any]) -> str:
    """A configuration with another access control. It is JSON, below lines of comments.

    Raises:
        ValueError: it is none.
    """
    lines = text.splitlines(keepends=True)
    comments = list(itertools.takewhile(lambda line: line.startswith("//"), lines))
    settings = json.loads("".join(lines[len(comments) :]))
    if not isinstance(settings, dict):
        raise ValueError("it has no fields")
    return f"{''.join(comments)}{json.dumps({**settings, ACCESS: access_control}, indent=2)}\n"
