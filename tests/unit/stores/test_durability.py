"""What a store has confirmed is on the disk, and where it is not there any more that is noticed."""

from __future__ import annotations

import logging
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from fleet.errors import StoreError
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import StoreFull
from keyexpr_schema.keyspace import STORE_REPLACE, STORE_STAMPS
from keyexpr_schema.payloads.system import (
    StoreAddress,
    StoreAskerAddress,
    StoreReplaced,
    StoreReplaceQuery,
    StoreStamps,
    StoreStampsQuery,
)
from keyexpr_schema.transport.stamps import text_of_stamp
from keyexpr_schema.transport.store.admission import Admission
from keyexpr_schema.transport.store.questions import Asked, StoreQuestions
from keyexpr_schema.transport.store.storage import Write
from keyexpr_schema.transport.store.troubles import Troubles

WAL, FILE = "state.sqlite-wal", "state.sqlite"


def write(number: int) -> Write:
    return Write(f"home/world/places/p{number}", number << 128, False, "text", b"x" * 200)


def crashed(folder: Path, to: Path, synced: int = 30, besides: int = 0) -> None:
    """In `to` what a store that was killed leaves behind."""
    with SqliteStore(folder) as store:
        for number in range(1, synced + 1):
            store.apply([write(number)])
        store.sync()
        for number in range(synced + 1, synced + besides + 1):
            store.apply([write(number)])
        shutil.copytree(folder, to)


def halved(log: Path) -> None:
    os.truncate(log, log.stat().st_size // 2)


@pytest.mark.parametrize(
    "damage", [Path.unlink, lambda log: os.truncate(log, 0), halved], ids=["gone", "empty", "half"]
)
def test_a_log_that_lacks_confirmed_changes_is_noticed_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, damage: Callable[[Path], None]
) -> None:
    crashed(tmp_path / "one", tmp_path / "two")
    with SqliteStore(tmp_path / "two") as store:
        whole = len(store.select("**"))
        before = store.changes(["**"], "", 1000).position
    assert (whole, caplog.records) == (30, [])
    shutil.rmtree(tmp_path / "two")
    crashed(tmp_path / "three", tmp_path / "two")
    damage(tmp_path / "two" / WAL)
    with SqliteStore(tmp_path / "two") as store:
        left = len(store.select("**"))
        assert left < 30
        assert store.changes(["**"], before, 1000).whole
        (said,) = [record.getMessage() for record in caplog.records]
        assert said.startswith(f"the last {30 - left} changes that the store {tmp_path / 'two'}")
        assert "state.sqlite-wal was deleted, emptied or cut" in said
        store.apply([write(1000)])
        store.sync()
    caplog.clear()
    with SqliteStore(tmp_path / "two") as store:
        assert len(store.select("**")) == left + 1
    assert caplog.records == []


def test_what_nobody_had_asked_about_may_be_gone_without_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """As after a power cut: the log goes back to where it was when it was synced."""
    folder, cut = tmp_path / "store", tmp_path / "cut"
    with SqliteStore(folder) as store:
        store.apply([write(1)])
        store.sync()
        length = (folder / WAL).stat().st_size
        store.apply([write(2)])
        shutil.copytree(folder, cut)
    os.truncate(cut / WAL, length)
    with SqliteStore(cut) as store:
        assert [w.stamp >> 128 for w in store.select("**")] == [1]
    assert caplog.records == []


def test_one_sync_does_for_all_before_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    real = os.fdatasync
    monkeypatch.setattr(os, "fdatasync", lambda file: (synced.append(file), real(file)))
    with SqliteStore(tmp_path) as store:
        for number in range(1, 100):
            store.apply([write(number)])
        assert synced == []
        for _ in range(3):
            store.sync()
        assert len(synced) == 1


def test_a_disk_that_does_not_sync_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: int) -> None:
        raise OSError(5, "Input/output error")

    with SqliteStore(tmp_path) as store:
        store.apply([write(1)])
        with monkeypatch.context() as patched:
            patched.setattr(os, "fdatasync", broken)
            with pytest.raises(StoreError, match="could not write: Input/output error"):
                store.sync()
        store.sync()


def test_what_is_compared_and_set_and_not_on_the_disk_is_done_once_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: int) -> None:
        raise OSError(28, "No space left on device")

    with SqliteStore(tmp_path) as store:

        def applied(*_: object) -> bool:
            return store.apply([write(1)]) == 1  # once, and then never again

        questions = StoreQuestions(store, applied, Admission(store), Troubles(), lambda: None)
        value = StoreReplaceQuery(keyexpr="world/places/p1", value="{}", request="r")

        def told() -> StoreReplaced:
            asked = Asked("home", STORE_REPLACE, StoreAskerAddress("robotctl"), value)
            answer = questions.answer(asked)
            assert isinstance(answer, StoreReplaced)
            return answer

        monkeypatch.setattr(os, "fdatasync", broken)
        for _ in range(2):
            assert told().done and "No space left" in (told().failing or "")
        monkeypatch.undo()
        now = told()
        assert (now.done, now.failing, now.value) == (True, None, "x" * 200)


def test_what_cannot_be_compared_and_set_without_room_says_why(tmp_path: Path) -> None:
    def full(*_: object) -> bool:
        raise StoreFull("the store could not write: No space left on device")

    with SqliteStore(tmp_path) as store:
        questions = StoreQuestions(store, full, Admission(store), Troubles(), lambda: None)
        value = StoreReplaceQuery(keyexpr="world/places/p1", value="{}", request="r")
        answer = questions.answer(
            Asked("home", STORE_REPLACE, StoreAskerAddress("robotctl"), value)
        )
    assert isinstance(answer, StoreReplaced)
    assert (answer.done, answer.failing) == (
        False,
        "the store could not write: No space left on device",
    )


class BusyStore(SqliteStore):
    """While it syncs, the next writes come."""

    def sync(self) -> None:
        """What comes meanwhile may not be on the disk."""
        super().sync()
        self.apply([write(2)])


def test_what_comes_while_the_store_syncs_is_not_confirmed_with_what_was_there(
    tmp_path: Path,
) -> None:
    with BusyStore(tmp_path) as store:
        questions = StoreQuestions(
            store, lambda *_: False, Admission(store), Troubles(), lambda: None
        )
        store.apply([write(1)])

        def told() -> tuple[str, ...]:
            keys = ("world/places/p1", "world/places/p2")
            asked = Asked("home", STORE_STAMPS, StoreAddress(), StoreStampsQuery(keys=keys))
            questions.sync([asked])
            answer = questions.answer(asked)
            assert isinstance(answer, StoreStamps)
            return answer.timestamps

        first, second = (text_of_stamp(write(number).stamp) for number in (1, 2))
        assert told() == (first, "")
        assert told() == (first, second)


def test_a_store_that_fails_the_moment_it_works_again_does_not_say_that_it_has_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is applied says on one thread that it works, while another cannot sync: whoever heard of
    no write and of no trouble would take it for lost."""

    def broken(_: int) -> None:
        raise OSError(28, "No space left on device")

    with SqliteStore(tmp_path) as store:
        troubles = Troubles()
        questions = StoreQuestions(
            store, lambda *_: False, Admission(store), troubles, lambda: None
        )
        keys = ("world/places/p1",)
        asked = Asked("home", STORE_STAMPS, StoreAddress(), StoreStampsQuery(keys=keys))
        store.apply([write(1)])
        troubles.fails(StoreFull("no room"))
        monkeypatch.setattr(os, "fdatasync", broken)

        class Meanwhile(logging.Handler):
            def emit(self, record: logging.LogRecord) -> None:
                if "again" in record.getMessage():
                    questions.sync([asked])

        log, meanwhile = logging.getLogger(Troubles.__module__), Meanwhile()
        log.addHandler(meanwhile)
        troubles.works()
        log.removeHandler(meanwhile)

        def told() -> StoreStamps:
            answer = questions.answer(asked)
            assert isinstance(answer, StoreStamps)
            return answer

        assert told().timestamps == ("",)
        assert "No space left" in (told().failing or "")
        monkeypatch.undo()
        questions.sync([asked])
        assert told().timestamps == (text_of_stamp(write(1).stamp),)
        assert told().failing is None
