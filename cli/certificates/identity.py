"""Who a certificate is of: `robot.hsr`, `operator.ana`, `planner`, `router.main`."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from cli.errors import BadArgument
from keyexpr_schema.errors import InvalidId
from keyexpr_schema.ids import check_id


class Kind(str, Enum):
    """What there are certificates for."""

    ROBOT = "robot"
    OPERATOR = "operator"
    PLANNER = "planner"
    RECORDER = "recorder"
    SIM = "sim"
    WORKERS = "workers"
    """The workers of several robots, in one process."""
    ROUTER = "router"


SERVICES = (Kind.ROUTER, Kind.PLANNER, Kind.RECORDER, Kind.SIM, Kind.WORKERS)
NAMED = (Kind.ROBOT, Kind.OPERATOR, Kind.ROUTER)
"""Kinds of which there are several."""
MAIN = "main"
"""A router that was given no name."""


@dataclass(frozen=True)
class Identity:
    """One of a kind; `name` is empty where there is one alone.

    Raises:
        BadArgument: the name cannot be one.
    """

    kind: Kind
    name: str = ""

    def __post_init__(self) -> None:
        if self.kind in NAMED:
            try:
                check_id(self.name, self.kind.value)
            except InvalidId as error:
                raise BadArgument(str(error)) from None
        elif self.name:
            raise BadArgument(f"there is one {self.kind.value}: it has no name of its own")

    @classmethod
    def parse(cls, text: str) -> Identity:
        """From `robot.hsr`.

        Raises:
            BadArgument: it is none.
        """
        kind, _, name = text.partition(".")
        kinds = {each.value: each for each in Kind}
        if kind not in kinds:
            raise BadArgument(
                f"{text!r} is nobody who can have a certificate; such are robot.NAME, "
                "operator.NAME, router.NAME, planner, recorder, sim, workers"
            )
        if kinds[kind] is Kind.ROUTER:
            name = name or MAIN
        return cls(kinds[kind], name)

    def __str__(self) -> str:
        return self.common_name

    @property
    def common_name(self) -> str:
        """The common name of its certificates, by which access is given."""
        return f"{self.kind.value}.{self.name}" if self.name else self.kind.value

    @property
    def file_name(self) -> str:
        """What its files' names begin with."""
        return self.common_name.replace(".", "-", 1)
