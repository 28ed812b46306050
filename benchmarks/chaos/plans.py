"""Which faults there are in a mission: drawn by chance, or those that once showed something."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path

import msgspec

from cli.processes.composition import PLANNER, ROUTER

KINDS = ("kill", "freeze", "power", "cut", "clock", "disk", "stop", "cancel")
DOWN_S = (0.0, 1.5)
LASTS_S = {
    "kill": DOWN_S,
    "freeze": (0.2, 5.0),
    "power": DOWN_S,
    "cut": (0.3, 6.0),
    "clock": (1.0, 5.0),
    "disk": (0.5, 4.0),
    "stop": (0.3, 4.0),
    "cancel": (0.0, 0.0),
}
AHEAD_S = (-600.0, -5.0, -0.3, 0.3, 5.0, 600.0)
GOAL, PLAN = "goal", "plan"
FOUND = Path(__file__).with_name("violations.json")


class Fault(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One fault of a mission: when it begins, counted from the mission's plan [s], how long it
    lasts [s], and to which processes or hosts it happens. `ahead_s` is of clocks [s]."""

    kind: str
    after_s: float
    lasts_s: float = 0.0
    of: tuple[str, ...] = ()
    ahead_s: float = 0.0


class Violation(msgspec.Struct, frozen=True, kw_only=True):
    """The faults of a mission under which a promise did not hold, until the cause was mended."""

    date: str
    showed: str
    faults: tuple[Fault, ...]


def drawn(
    rnd: random.Random, number: int, within_s: float, kinds: Sequence[str], robots: Sequence[str]
) -> tuple[Fault, ...]:
    """So many faults of these kinds, in order of time, the same ones for the same chance."""
    workers = [f"worker-{robot}" for robot in robots]
    anybody = [ROUTER, PLANNER, *workers]
    ours = (ROUTER, PLANNER)
    of: dict[str, list[tuple[str, ...]]] = {
        "kill": [(name,) for name in anybody],
        "freeze": [(name,) for name in anybody],
        "power": [ours, ours[:1], ours[1:], tuple(anybody)],
        "cut": [("office",), ("robots",)],
        "clock": [(name,) for name in (PLANNER, *workers)],
        "disk": [(name,) for name in anybody],
        "stop": [()],
        "cancel": [(GOAL,), (PLAN,)],
    }
    faults = []
    for _ in range(number):
        kind = rnd.choice(sorted(kinds))
        faults.append(
            Fault(
                kind=kind,
                after_s=round(rnd.uniform(0.0, within_s), 2),
                lasts_s=round(rnd.uniform(*LASTS_S[kind]), 2),
                of=rnd.choice(of[kind]),
                ahead_s=rnd.choice(AHEAD_S) if kind == "clock" else 0.0,
            )
        )
    return tuple(sorted(faults, key=lambda fault: fault.after_s))


def found() -> tuple[Violation, ...]:
    """What chaos has shown so far, oldest first."""
    return msgspec.json.decode(FOUND.read_bytes(), type=tuple[Violation, ...])


def one_after_another(violations: Sequence[Violation]) -> tuple[Fault, ...]:
    """The faults of all of them in one mission: each when the one before is over."""
    faults: list[Fault] = []
    for violation in violations:
        over_s = max((fault.after_s + fault.lasts_s for fault in faults), default=0.0)
        faults += [
            msgspec.structs.replace(fault, after_s=over_s + fault.after_s)
            for fault in violation.faults
        ]
    return tuple(faults)


def as_text(faults: Sequence[Fault]) -> str:
    """The faults of a mission, as `violations.json` has them."""
    return msgspec.json.encode(faults).decode()
