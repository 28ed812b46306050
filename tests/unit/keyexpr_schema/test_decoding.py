"""Payloads are decoded from several threads at once, and have no numbers that nothing can keep."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.keyspace import FACT, GOAL_SPEC
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
