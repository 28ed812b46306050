"""The Zenoh configuration of somebody who has a certificate: TLS on both sides (mTLS)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cli.certificates.identity import Identity, Kind


def zenoh_settings(
    identity: Identity,
    authority: Path,
    certificate: Path,
    key: Path,
    connect: Sequence[str] = (),
    listen: Sequence[str] = (),
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
    return (
        f"// {identity}: made by `robotctl certs`, which writes it anew with each certificate.\n"
        f"{json.dumps(settings, indent=2)}\n"
    )
