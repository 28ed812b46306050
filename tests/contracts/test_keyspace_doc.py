"""docs/keyspace.md is what the code says."""

from __future__ import annotations

from pathlib import Path

from keyexpr_schema.document import document
from keyexpr_schema.key import Delivery
from keyexpr_schema.keyspace import KEYSPACE

PAGE = Path(__file__).parents[2] / "docs" / "keyspace.md"


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == document(), "run python -m keyexpr_schema.document"


def test_each_key_has_one_writer() -> None:
    """But for facts, whose latest word holds, for what names its writer in the key, and for the
    state of a robot, which whoever unregisters it deletes."""
    many = {key.name for key in KEYSPACE if len(key.writers) > 1}
    queries = {key.name for key in KEYSPACE if key.delivery is Delivery.QUERY}
    assert many - queries == {"fact", "reject", "diagnostic", "robot_state"}


def test_the_page_shows_every_key_and_no_module_paths():
    page = document()
    for key in KEYSPACE:
        assert page.count(f"`{key.template}`") == 2
    assert "keyexpr_schema." not in page.split("# The key-space")[1]
    assert "msgspec" not in page
