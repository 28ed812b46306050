"""What a session is opened with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from keyexpr_schema.endpoints import check_endpoints
from keyexpr_schema.ids import check_id

if TYPE_CHECKING:
    from keyexpr_schema.transport.zenoh_file import ZenohFile


@dataclass(frozen=True)
class SessionConfig:
    """Where the routers are, in which realm we act, and who we are.

    `component` is `planner`, `worker-ROBOT`, `sim`, `recorder` or `robotctl`, anything else for a
    program of one's own; it signs reports of undecodable values. `connect_timeout_s` None: wait for
    a router for ever. `lease_s`: after this long without a sign of life the other side is gone.
    `by` is the person whom it acts for, who is named with each deletion. `urgent`: what it puts
    cannot wait until a clock is set right, and needs no store. `answer_s`: how long a store
    may take to list something; a process that would end without waits longer. `zenoh_config` is a
    Zenoh configuration file with all else (see `zenoh_file`), or what was read of one; with no
    `endpoints` they are its own.
    """

    endpoints: tuple[str, ...]
    realm: str = "robotfleet"
    component: str = "client"
    connect_timeout_s: float | None = 3.0
    lease_s: float = 2.0
    by: str = ""
    urgent: bool = False
    answer_s: float = 3.0
    zenoh_config: Path | ZenohFile | None = None

    def __post_init__(self) -> None:
        check_id(self.realm, "realm")
        check_id(self.component, "component")
        check_endpoints(self.endpoints)
