"""The configurations of routers that users copy."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import zenoh

from keyexpr_schema.keyspace import KEYSPACE
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.zenoh_file import read_zenoh_file

CONFIGS = Path(__file__).parents[3] / "configs" / "routers"


@pytest.mark.parametrize("name", ["zenohd-storage.json5", "office/first-floor.json5"])
def test_zenohd_reads_it(name):
    config = zenoh.Config.from_file(CONFIGS / name)
    assert json.loads(config.get_json("connect/exit_on_failure")) in (None, False)
    assert json.loads(config.get_json("transport/shared_memory/enabled")) is False


OURS = sorted(path for path in CONFIGS.rglob("*.json5") if path.name != "zenohd-storage.json5")


@pytest.mark.parametrize("path", OURS, ids=lambda path: path.name)
def test_robotctl_reads_it_for_a_router_and_for_what_connects(path):
    file = read_zenoh_file(path)
    assert file.listens()
    assert file.connects("client")
    for mode in ("client", "router"):
        zenoh_config(mode, file=file)


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
