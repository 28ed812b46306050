"""Errors of the stores."""

from __future__ import annotations

from fleet.errors import FleetError


class StoreError(FleetError):
    """A store cannot be used; the message says why and what would help."""


class StoreInUse(StoreError):
    """Another process has this store open."""
