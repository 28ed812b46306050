"""Journals as files: events in, effects out, one a line.

`python -m tests.replay.journal_files PLANNER_DATA_DIR NAME` makes `NAME.events.jsonl` from what a
planner kept, and `NAME.effects.txt` from what the core does with it now. With `NAME` alone only the
effects are made again, which is right when the core is meant to do something else. Look at what
changed, then commit.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from fleet.core.effects import Interpret, MakePlan, Publish, Retract
from fleet.core.events import Event, decode_event, encode_event
from fleet.core.state import State
from fleet.core.step import step
from fleet.service.event_journal import EventJournal
from tests.support.household import SKILLS

HERE = Path(__file__).parent
SHOWN = ("state", "revision", "robot", "attempt", "epoch", "cancelled", "accepted", "value")
"""Fields of documents that an effect's line shows."""


def events_in(name: str) -> list[Event]:
    """The events of a committed journal."""
    lines = (HERE / f"{name}.events.jsonl").read_bytes().splitlines()
    return [decode_event(line) for line in lines if line]


def effects_of(journal: list[Event]) -> Iterator[str]:
    """What the core does with a journal: a line an effect, an empty line an event."""
    state = State(skills=SKILLS)
    for event in journal:
        state, effects = step(state, event)
        for effect in effects:
            match effect:
                case Publish(key, address, payload):
                    shown = [
                        f"{field}={getattr(payload, field)}"
                        for field in SHOWN
                        if hasattr(payload, field)
                    ]
                    yield f"put {key.build(address)} {' '.join(shown)}"
                case Retract(key, address):
                    yield f"delete {key.build(address)}"
                case MakePlan(given):
                    yield f"plan {given.job.plan} revision {given.job.revision}"
                case Interpret(given):
                    yield f"interpret {given.goal}"
        yield ""


def _write_effects(name: str) -> None:
    (HERE / f"{name}.effects.txt").write_text("\n".join(effects_of(events_in(name))) + "\n")


if __name__ == "__main__":
    if len(sys.argv) == 3:
        data, made = Path(sys.argv[1]), sys.argv[2]
        with EventJournal(data) as kept:
            lines = [encode_event(event) for _, event in kept.events()]
        (HERE / f"{made}.events.jsonl").write_bytes(b"\n".join(lines) + b"\n")
    _write_effects(sys.argv[-1])
