"""Errors of the contract: what a caller of this package may have to handle."""

from __future__ import annotations


class SchemaError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class InvalidId(SchemaError):
    """A name cannot be a chunk of a key expression."""


class BrokenPlugIn(SchemaError):
    """An installed package offers something that cannot be used; the message names both."""


class ForeignKey(SchemaError):
    """A key expression does not belong to the key that was asked to parse it."""


class UndecodablePayload(SchemaError):
    """Bytes on a key are not a payload of the type that the key promises."""


class NoConfigFile(SchemaError):
    """No configuration file has the name that was given."""


class Unreachable(SchemaError):
    """No router answers at the configured endpoints."""


class Unconfirmed(SchemaError):
    """A write that must last was not read back from storage before its deadline."""


class NoAnswer(SchemaError):
    """A query ended without a reply: nobody serves the key, or the server was too slow."""
