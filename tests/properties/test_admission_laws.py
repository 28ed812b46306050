"""What a store has counted while it took writes in judges as one that counts anew."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.limits import Limits
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.storage import Write

NOW_S = 1_000_000.0
NAMES = ("a", "b", "c", "d", "e", "f")
LIMITS = Limits(goals=4, facts=5)
KEYS = [f"{realm}/goals/{name}/spec" for realm in ("r", "s") for name in NAMES]
KEYS += [f"r/world/facts/{name}/at" for name in NAMES]


@st.composite
def writes(draw: st.DrawFn) -> Write:
    """Puts and deletions of few keys by few writers, whose clocks differ."""
    after_s, writer = draw(st.integers(0, 9)), draw(st.integers(1, 3))
    deleted = draw(st.booleans())
    if deleted and draw(st.integers(0, 3)) == 0:
        keyexpr = f"r/goals/{draw(st.sampled_from(NAMES))}/**"
    else:
        keyexpr = draw(st.sampled_from(KEYS))
    stamp = int((NOW_S - 10.0 + after_s) * 2**32) << 128 | writer
    return Write(keyexpr, stamp, deleted, "", b"" if deleted else b"x")


@given(st.lists(st.lists(writes(), min_size=1, max_size=6), max_size=8))
def test_what_was_counted_judges_as_what_is_counted_anew(batches: list[list[Write]]) -> None:
    with tempfile.TemporaryDirectory() as folder, SqliteStore(Path(folder)) as store:
        counted = Admission(store, LIMITS, lambda: NOW_S, lambda: NOW_S)
        for batch in batches:
            anew = Admission(store, LIMITS, lambda: NOW_S, lambda: NOW_S)
            taken = counted.admitted(batch)
            assert taken == anew.admitted(batch)
            store.apply(taken)
