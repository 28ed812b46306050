"""Errors of planning by language model: what a user got wrong in its configuration."""

from __future__ import annotations

from fleet.errors import FleetError


class BadLlmConfig(FleetError):
    """Configuration or prompts cannot be used; one sentence says which field or file, and why."""
