"""The durable store behind a router: what every key holds, and the journal of what changed."""

from fleet.errors import StoreError, StoreInUse
from fleet.stores.sqlite import SqliteStore, StoreMemory

__all__ = ["SqliteStore", "StoreError", "StoreInUse", "StoreMemory"]
