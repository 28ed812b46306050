"""Payloads are decoded from several threads at once, and have no numbers that nothing can keep."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec import inspect

from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.keyspace import FACT, GOAL_SPEC, KEYSPACE
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.world import Fact, FactAddress

GOLDEN = Path(__file__).parents[2] / "contracts" / "golden" / "order.1.full.json"
PROGRAM = """
import sys, threading
from pathlib import Path
from keyexpr_schema.decoding import decode
from keyexpr_schema.payloads.tasks import Order
data = Path(sys.argv[1]).read_bytes()
sys.setswitchinterval(1e-6)
together = threading.Barrier(6)
orders = []
def read():
    together.wait()
    orders.append(decode(data, Order))
threads = [threading.Thread(target=read) for _ in range(6)]
for thread in threads: thread.start()
for thread in threads: thread.join()
assert len(orders) == 6 and len(set(map(repr, orders))) == 1
"""


def test_the_first_to_decode_a_type_may_be_many_threads() -> None:
    for _ in range(5):  # a fresh process each: only the first time counts
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, str(GOLDEN)], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("number", [10**20, -(10**20), 2**63])
def test_a_number_that_no_snapshot_could_keep_is_refused_by_writers_and_readers(
    number: int,
) -> None:
    goal = Goal(goal="g", text="Search the hallway", priority=number)
    with pytest.raises(UndecodablePayload, match=f"{number} is larger than any number"):
        GOAL_SPEC.check(goal, GoalAddress("g"))
    fact = Fact(subject="jug", relation="level", value=number, source="person:ana")
    with pytest.raises(UndecodablePayload, match=f"{number} is larger"):
        FACT.check(fact, FactAddress("jug", "level"))


def test_long_rows_of_digits_in_texts_and_fractions_are_none() -> None:
    goal = Goal(goal="g", text="1" * 30, priority=2**63 - 1)
    assert GOAL_SPEC.decode(GOAL_SPEC.check(goal, GoalAddress("g"))) == goal
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(goal), type=Goal) == goal
    data = GOAL_SPEC.encode(goal)[:-1] + b',"said_s":0.12345678901234567890}'
    assert GOAL_SPEC.decode(data).goal == "g"


@pytest.mark.parametrize("number", ["1e308", "-1e308", "1e12", "2" * 30])
def test_a_time_that_no_calendar_has_and_a_length_that_no_world_has_are_refused(
    number: str,
) -> None:
    """They ended the recorder, which counts nanoseconds."""
    data = b'{"subject":"cup","relation":"at","value":"x","source":"s","time_s":%s}'
    with pytest.raises(UndecodablePayload, match="larger than any number that can be meant"):
        FACT.decode(data % number.encode())
    assert FACT.decode(data % b"1e11").time_s == 1e11


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "nan"])
def test_what_is_no_number_is_refused(number: str) -> None:
    data = f'{{"subject":"cup","relation":"at","value":{number},"source":"s"}}'
    with pytest.raises(UndecodablePayload):
        FACT.decode(data.encode())


@pytest.mark.parametrize("opened", [b"[", b'{"a":'])
def test_what_is_nested_without_end_is_refused_wherever_it_stands(opened: bytes) -> None:
    """No payload holds itself, so what is deep stands where nothing is expected."""
    for data in (opened * 100_000, b'{"x":' + opened * 100_000 + b"1"):
        with pytest.raises(UndecodablePayload):
            FACT.decode(data)


def holds_itself(kind: inspect.Type, around: tuple[Any, ...] = ()) -> bool:
    """Whether a value of the type can be nested without end."""
    inner = [*getattr(kind, "types", ()), *getattr(kind, "item_types", ())]
    inner += [getattr(kind, name, None) for name in ("item_type", "key_type", "value_type")]
    if isinstance(kind, inspect.StructType):
        if kind.cls in around:
            return True
        around = (*around, kind.cls)
        inner = [field.type for field in kind.fields]
    return any(holds_itself(each, around) for each in inner if isinstance(each, inspect.Type))


def test_no_payload_holds_itself() -> None:
    """So the depth of what is taken in has a bound, and nobody who goes through it needs one."""
    kinds = {kind for key in KEYSPACE for kind in (key.payload, key.reply) if kind is not None}
    assert [kind for kind in kinds if holds_itself(inspect.type_info(kind))] == []
