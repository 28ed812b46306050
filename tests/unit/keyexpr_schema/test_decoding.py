"""Payloads are decoded from several threads at once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

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
