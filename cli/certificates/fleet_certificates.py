"""What the processes of a fleet on one machine are certified as; made where it is missing."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cli.certificates.authority import CA_KEY, Authority
from cli.certificates.identity import MAIN, Identity, Kind
from cli.processes.composition import PLANNER, RECORDER, ROUTER, SIM, worker_of

RENEWED_BEFORE = timedelta(days=30)
"""A certificate that holds for less is made anew."""
PROCESSES = {
    ROUTER: Identity(Kind.ROUTER, MAIN),
    PLANNER: Identity(Kind.PLANNER),
    RECORDER: Identity(Kind.RECORDER),
    SIM: Identity(Kind.SIM),
}


class FleetCertificates:
    """The certificates of a fleet in `folder`, whose authority is made if there is none.

    `processes`: Zenoh configurations by the names of processes; `operator`: that of `user`, who
    starts them. Each robot's worker is a process of its own, which may do what is for that robot.

    Raises:
        BadCertificates: the folder cannot be used.
        BadArgument: `user` cannot be the name of an operator.
    """

    def __init__(self, folder: Path, realm: str, user: str) -> None:
        self.user = user
        there = (folder / CA_KEY).exists()
        self._authority = Authority(folder) if there else Authority.create(folder, realm)
        self.processes = {name: self._held(identity) for name, identity in PROCESSES.items()}
        self.operator = self._held(Identity(Kind.OPERATOR, user))
        self._authority.renew_access()

    def admit(self, robots: Iterable[str]) -> bool:
        """Certify the workers of robots; whether routers that run have to be started again, since
        Zenoh reads its access control when it starts."""
        for robot in robots:
            self.processes[worker_of(robot)] = self._held(Identity(Kind.ROBOT, robot))
        return bool(self._authority.renew_access())

    def _held(self, identity: Identity) -> Path:
        authority = self._authority
        files = authority.files(identity)
        least_s = (datetime.now(UTC) + RENEWED_BEFORE).timestamp()
        holds = any(
            each.identity == str(identity) and not each.revoked and each.expires_s > least_s
            for each in authority.issued()
        )
        complete = all(path.exists() for path in (files.certificate, files.key, files.settings))
        return (files if holds and complete else authority.issue(identity)).settings.absolute()
