"""Everybody who has a certificate, and what they sign."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cryptography import x509

from cli.certificates.authority import Authority as Office
from cli.certificates.identity import Identity
from keyexpr_schema.key import Address, Key
from keyexpr_schema.keyspace import GOAL_SPEC
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.credentials import Credentials, of_client, of_router
from keyexpr_schema.transport.samples import Encoded, encoding_of
from keyexpr_schema.transport.signatures import Authority, Signer
from keyexpr_schema.transport.stamps import stamp_of, text_of_stamp, ticks_of_time
from keyexpr_schema.transport.zenoh_file import read_zenoh_file

NOW = datetime(2026, 11, 29, 12, 0, tzinfo=UTC)
NOW_S = NOW.timestamp()
STAMP = stamp_of(ticks_of_time(NOW_S - 1.0), 7)
ANA_WANTS = Goal(goal="g1", text="Bring the cup.", said_by="ana")
NOBODY = ("robot.hsr", "robot.locobot", "operator.ana", "operator.bob", "planner", "workers")


def value_at(key: Key[Any, Any], address: Address, payload: Any, realm: str = "home") -> Encoded:
    return Encoded(f"{realm}/{key.build(address)}", key.encode(payload), encoding_of(key))


GOAL = value_at(GOAL_SPEC, GoalAddress("g1"), ANA_WANTS)


class Certified:
    """Everybody who has a certificate, and who judges them at `NOW`."""

    def __init__(self, folder: Path, now: datetime = NOW, days: int = 365) -> None:
        self.office = Office.create(folder, "home", now)
        self.office.issue(Identity.parse("router"), now=now)
        for name in NOBODY:
            self.office.issue(Identity.parse(name), days=days, now=now)
        self.roots = [x509.load_pem_x509_certificate((folder / "ca.pem").read_bytes())]
        self.authority = Authority(self.roots, now_s=lambda: NOW_S)

    def credentials(self, name: str) -> Credentials:
        file = read_zenoh_file(self.office.files(Identity.parse(name)).settings)
        found = of_router(file) if name == "router" else of_client(file)
        assert found is not None
        return found

    def signer(self, name: str) -> Signer:
        signer = self.credentials(name).signer
        assert signer is not None
        return signer

    def signed(self, name: str, value: Encoded, stamp: int = STAMP) -> Attachment:
        """What one of them sends beside a value, as it comes out of the link."""
        signer = self.signer(name)
        text = signer.attachment(value.keyexpr, text_of_stamp(stamp), value.data, 12)
        return Attachment.read((text or "").encode())

    def deletes(self, name: str, keyexpr: str, stamp: int = STAMP) -> Attachment:
        """What one of them sends beside a deletion."""
        text = self.signer(name).attachment(keyexpr, text_of_stamp(stamp), None)
        return Attachment.read((text or "").encode())

    def objection(self, name: str, value: Encoded) -> str | None:
        return self.authority.objection(value, STAMP, self.signed(name, value))
