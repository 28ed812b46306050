"""Where robots' workers were put as containers."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

import msgspec

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload

HOST_PATTERN = r"^[A-Za-z0-9_][A-Za-z0-9_.@:-]{0,252}$"
Host = Annotated[str, msgspec.Meta(pattern=HOST_PATTERN)]
"""A host as ssh takes it (`ana@lab-3`), or a node of a cluster; never an option of ssh."""


class Engine(str, Enum):
    """What runs a container."""

    PODMAN = "podman"
    DOCKER = "docker"
    KUBERNETES = "kubernetes"


class Deployment(Payload, frozen=True, kw_only=True):
    """A robot's worker that somebody has had run as a container, until it is taken away.

    `host`: where, over ssh; None: where whoever deployed it was, `machine` as that calls itself, or
    in the cluster. `since_s` is Unix time.
    """

    robot: Id
    engine: Engine
    image: str
    container: Id
    host: Host | None = None
    machine: str = ""
    by: Author = ""
    since_s: float = 0.0

    @property
    def where(self) -> str:
        """In words: `podman on lab-3`."""
        if self.engine is Engine.KUBERNETES:
            return f"{self.engine.value}"
        return f"{self.engine.value} on {self.host or self.machine or 'some host'}"
