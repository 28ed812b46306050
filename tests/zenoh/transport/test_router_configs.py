"""The zenohd configurations that users copy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import zenoh

from keyexpr_schema.keyspace import KEYSPACE

CONFIGS = Path(__file__).parents[3] / "configs" / "routers"


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.json5")), ids=lambda path: path.name)
def test_zenoh_reads_it(path):
    config = zenoh.Config.from_file(path)
    assert config.get_json("mode") == '"router"'


def test_the_zenohd_storages_hold_every_stored_key_once_and_nothing_else():
    config = zenoh.Config.from_file(CONFIGS / "zenohd-storage.json5")
    storages = json.loads(config.get_json("plugins/storage_manager/storages"))
    patterns = {name: zenoh.KeyExpr(one["key_expr"]) for name, one in storages.items()}
    for key in KEYSPACE:
        keyexpr = zenoh.KeyExpr("robotfleet/" + key.pattern())
        holding = [name for name, pattern in patterns.items() if pattern.intersects(keyexpr)]
        assert len(holding) == (1 if key.stored else 0), (key.name, holding)
        assert all(patterns[name].includes(keyexpr) for name in holding)
    assert len({one["volume"]["dir"] for one in storages.values()}) == len(storages)
