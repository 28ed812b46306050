"""Writes on their way into a store: in turn, in order; questions wait for what they ask about."""

from __future__ import annotations

from keyexpr_schema.keyspace import KEY_TREES, KEYSPACE
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.stamps import source_of_stamp
from keyexpr_schema.transport.store.patterns import matcher
from keyexpr_schema.transport.store.storage import Write, deletes_tree, is_stored, tree_over
from keyexpr_schema.transport.store.write_queues import BATCH, REFUSED, WriteQueues

FLOODER, FRIEND, PLANNER = 1, 2, 3


def write(key: str, writer: int, number: int = 1, data: bytes = b"x") -> Write:
    return Write(f"north/{key}", number << 128 | writer, False, "application/json", data)


def fact(name: str, writer: int, number: int = 1) -> Write:
    return write(f"world/facts/{name}/at", writer, number)


def flooded(writes: int, **limits: int) -> WriteQueues[str]:
    queues: WriteQueues[str] = WriteQueues(**limits)
    for number in range(1, writes + 1):
        queues.put(fact(f"thing{number}", FLOODER, number))
    return queues


def test_one_write_waits_for_one_of_whoever_has_thousands():
    queues = flooded(1000)
    queues.put(fact("cup", FRIEND))
    batch = queues.take(most=2)
    assert [source_of_stamp(each.stamp) for each in batch] == [FLOODER, FRIEND]
    assert len(queues) == 999


def test_what_is_judged_is_judged_in_turn_and_what_is_refused_keeps_no_question_waiting():
    queues = flooded(1000)
    queues.put(fact("cup", FRIEND))
    queues.hold("mine", ["north/world/facts/cup/at"], [])
    judged: list[int] = []

    def judge(write: Write, _: Attachment) -> Write | None:
        judged.append(source_of_stamp(write.stamp))
        return None

    assert queues.take(judge=judge) == []
    assert (judged[:2], len(judged)) == ([FLOODER, FRIEND], REFUSED)
    assert queues.applied() == ["mine"]
    assert len(queues) == 1001 - REFUSED
    assert len(queues.take(judge=lambda write, _: write)) == BATCH


def test_a_question_waits_for_the_writes_of_its_keys_alone():
    queues = flooded(10)
    queues.put(fact("cup", FRIEND))
    assert not queues.hold("other", ["north/world/facts/plate/at"], [])
    assert queues.hold("mine", ["north/world/facts/cup/at"], [])
    assert queues.hold("all", [], ["north/world/facts/*/*"])
    assert not queues.hold("goals", [], ["north/goals/*/spec"])
    queues.take(most=2)
    assert queues.applied() == ["mine"]
    queues.take()
    assert queues.applied() == ["all"]
    assert not queues.hold("later", [], ["north/**"])


def test_a_question_about_a_thousand_keys_makes_no_expression_of_them():
    """That takes 50 ms, in which nothing is stored, and 0.3 MB that would be kept."""
    queues = flooded(10)
    made = matcher.cache_info().misses
    keys = [f"north/world/facts/thing{number}/at" for number in range(5, 1000)]
    assert queues.hold("all of these", [], keys)
    assert not queues.hold("others", [], keys[20:])
    assert matcher.cache_info().misses == made
    queues.take()
    assert queues.applied() == ["all of these"]


def test_what_is_taken_is_waited_for_until_it_is_applied():
    queues = flooded(1)
    queues.take()
    assert queues.hold("mine", ["north/world/facts/thing1/at"], [])
    assert queues.applied() == ["mine"]


def test_what_comes_after_a_question_holds_it_up_no_longer():
    queues = flooded(1)
    queues.hold("mine", ["north/world/facts/thing1/at"], [])
    queues.put(fact("thing1", FLOODER, 2))
    queues.take(most=1)
    assert queues.applied() == ["mine"]


def test_writes_of_one_key_stay_in_order_whoever_wrote_them():
    queues = flooded(3)
    queues.put(fact("thing3", FRIEND, 9))
    queues.put(fact("cup", FRIEND, 10))
    taken = [each.keyexpr.split("/")[3] for each in queues.take()]
    assert taken == ["thing1", "thing2", "thing3", "thing3", "cup"]
    assert not len(queues)


def test_a_question_for_a_key_waits_for_a_deletion_of_its_tree_that_comes_first_in_a_batch():
    queues = flooded(1)
    queues.put(
        Write("north/goals/g1/*", 5 << 128 | PLANNER, True, "", b""),
    )
    assert queues.hold("goal", ["north/goals/g1/spec"], [])
    assert not queues.hold("another", ["north/goals/g2/spec"], [])
    assert [each.keyexpr for each in queues.take()] == ["north/world/facts/thing1/at"]
    assert queues.applied() == []
    assert [each.keyexpr for each in queues.take()] == ["north/goals/g1/*"]
    assert queues.applied() == ["goal"]


def test_large_values_go_a_few_at_a_time_and_fill_the_queues():
    queues: WriteQueues[str] = WriteQueues(most_bytes=300)
    for number in range(1, 4):
        assert not queues.full
        queues.put(write(f"goals/g{number}/spec", FLOODER, number, b"x" * 100))
    assert queues.full
    assert len(queues.take(most_bytes=150)) == 2
    queues.applied()
    assert not queues.full
    assert flooded(7, most=7).full


def test_the_tree_over_a_key_is_the_one_deletion_with_wildcards_that_concerns_it():
    deletions = [f"north/{tree.build('1')}" for tree in KEY_TREES if "*" in tree.template]
    assert all(map(deletes_tree, deletions))
    for key in KEYSPACE:
        keyexpr = f"north/{key.pattern().replace('*', '1')}"
        concern = [each for each in deletions if matcher(each).fullmatch(f"/{keyexpr}")]
        assert concern in ([], [tree_over(keyexpr)]), keyexpr
        assert bool(concern) == bool(tree_over(keyexpr)), keyexpr


def test_a_pattern_with_many_wildcards_in_a_chunk_is_matched_at_once():
    pattern = f"north/goals/{'$*a' * 30}$*b$*/spec"
    assert not matcher(pattern).fullmatch(f"/north/goals/{'a' * 63}/spec")
    assert matcher(pattern).fullmatch(f"/north/goals/{'a' * 62}b/spec")
    assert matcher(pattern).fullmatch(f"/north/goals/{'xa' * 30}bx/spec")
    assert not matcher("north/goals/a$*a$*a/spec").fullmatch("/north/goals/aa/spec")


def test_what_is_written_to_all_realms_is_no_key_and_deletes_no_tree():
    for realm in ("*", "**", "nor$*"):
        assert not is_stored(f"{realm}/goals/g1/spec")
        assert not tree_over(f"{realm}/goals/g1/spec")
        assert not any(deletes_tree(f"{realm}/{tree.build('p1')}") for tree in KEY_TREES)
