"""What the processes of a fleet on one machine are certified as; made where it is missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cli.certificates.authority import CA_KEY, Authority
from cli.certificates.identity import MAIN, Identity, Kind
from cli.processes.composition import PLANNER, RECORDER, ROUTER, SIM, WORKERS

RENEWED_BEFORE = timedelta(days=30)
"""A certificate that holds for less is made anew."""
PROCESSES = {
    ROUTER: Identity(Kind.ROUTER, MAIN),
    PLANNER: Identity(Kind.PLANNER),
    RECORDER: Identity(Kind.RECORDER),
    SIM: Identity(Kind.SIM),
    WORKERS: Identity(Kind.WORKERS),
}


@dataclass(frozen=True)
class FleetCertificates:
    """Zenoh configurations: of each process by name, and of who starts them."""

    processes: Mapping[str, Path]
    operator: Path


def fleet_certificates(folder: Path, realm: str, user: str) -> FleetCertificates:
    """The certificates of a fleet in `folder`, whose authority is made if there is none.

    Raises:
        BadCertificates: the folder cannot be used.
        BadArgument: `user` cannot be the name of an operator.
    """
    there = (folder / CA_KEY).exists()
    authority = Authority(folder) if there else Authority.create(folder, realm)
    return FleetCertificates(
        {name: _held(authority, identity) for name, identity in PROCESSES.items()},
        _held(authority, Identity(Kind.OPERATOR, user)),
    )


def _held(authority: Authority, identity: Identity) -> Path:
    files = authority.files(identity)
    least_s = (datetime.now(UTC) + RENEWED_BEFORE).timestamp()
    holds = any(
        each.identity == str(identity) and not each.revoked and each.expires_s > least_s
        for each in authority.issued()
    )
    complete = all(path.exists() for path in (files.certificate, files.key, files.settings))
    return (files if holds and complete else authority.issue(identity)).settings.absolute()
