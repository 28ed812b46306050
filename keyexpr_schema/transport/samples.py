"""What travels on a Zenoh link, in plain Python: samples, their timestamps, their encodings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import zenoh

from keyexpr_schema.errors import UndecodablePayload
from keyexpr_schema.key import SCHEMA_PREFIX, A, Key, P, Payload, decode_payload
from keyexpr_schema.limits import Limits, in_force, too_long
from keyexpr_schema.transport.stamps import (
    source_of_stamp,
    stamp_of_text,
    ticks_of_stamp,
    time_s_of_stamp,
)

ENCODING_PREFIX = "application/json;"
_REPLY_VERSION = 1


def too_far_ahead(
    stamp: int,
    now_s: Callable[[], float],
    stamped_s: Callable[[], float],
    limits: Limits | None = None,
) -> str | None:
    """Why a write that says that it is from the future is not taken in, if it does.

    Zenoh gives another stamp to values that are ahead, and to deletions none; whoever believed one
    would hear nothing new of its key until then. `now_s` is the clock of this host and `stamped_s`
    that of its own stamps, which is not set back with it [s, Unix].
    """
    most_s = (limits or in_force()).ahead_s
    if time_s_of_stamp(stamp) - now_s() <= most_s:
        return None
    ahead_s = time_s_of_stamp(stamp) - stamped_s()
    if ahead_s <= most_s:
        return None
    return f"its time stamp is {ahead_s:.0f} s ahead of the clock here: set the clock of its writer"


def timestamp_of_stamp(stamp: int) -> zenoh.Timestamp:
    """A Zenoh timestamp near `stamp`: at most 5 ns older, never newer.

    Zenoh's Python API cannot set the lowest bits of a timestamp, so exact stamps travel as text
    in the attachment of a stored reply (see `read_stored`). Rounding down means that a reader that
    knows only the timestamp never prefers the stored value to a newer live one.
    """
    ticks = ticks_of_stamp(stamp)
    seconds, fraction = ticks >> 32, ticks & 0xFFFF_FFFF
    nanos = max(0, fraction * 1_000_000_000 // (1 << 32) - 1)
    source = (source_of_stamp(stamp) or 1).to_bytes(16, "big")
    return zenoh.Timestamp(zenoh.NTP64(seconds, nanos), source)


def stamped_s(session: zenoh.Session) -> float:
    """Now by the clock of a session's timestamps [s, Unix], which is never set back."""
    return time_s_of_stamp(stamp_of_text(str(session.new_timestamp())))


@dataclass(frozen=True)
class Encoded:
    """Bytes as they came over the link, on which key, and what they say they are."""

    keyexpr: str
    data: bytes
    encoding: str


@dataclass(frozen=True)
class Sample(Encoded):
    """A value or a deletion. `stamp` 0: it carried no timestamp. `received`: the store's receipt of
    it [µs], where the store was asked; 0 of what passes, beside which `attached` travels."""

    stamp: int
    deleted: bool
    received: int = 0
    attached: bytes = b""


def attached_to(sample: zenoh.Sample) -> bytes:
    """What travels beside it; see `attachments`."""
    return b"" if sample.attachment is None else sample.attachment.to_bytes()


def read_sample(sample: zenoh.Sample) -> Sample:
    """Copy a live `sample` out of Zenoh. Whatever it has attached says nothing of its stamp."""
    stamp = 0 if sample.timestamp is None else stamp_of_text(str(sample.timestamp))
    return Sample(
        str(sample.key_expr),
        sample.payload.to_bytes(),
        str(sample.encoding),
        stamp,
        deleted=sample.kind == zenoh.SampleKind.DELETE,
        attached=attached_to(sample),
    )


def read_stored(sample: zenoh.Sample) -> Sample:
    """Copy a reply of a store out of Zenoh.

    The stamp is the one in the attachment where there is one (the embedded store cannot rebuild a
    timestamp exactly after a restart), else the sample's timestamp (a zenohd storage).
    """
    found = replace(read_sample(sample), attached=b"")
    if sample.attachment is None:
        return found
    try:
        return replace(found, stamp=stamp_of_text(sample.attachment.to_string()))
    except (ValueError, UnicodeDecodeError, zenoh.ZError):
        return found


def encoding_of(key: Key[Any, Any]) -> str:
    """The Zenoh encoding of values of `key`, e.g. `application/json;robotfleet/fact/1`."""
    return ENCODING_PREFIX + key.schema


def reply_encoding_of(key: Key[Any, Any]) -> str:
    """The Zenoh encoding of replies on `key`, e.g. `…;robotfleet/store_journal_reply/1`."""
    return f"{ENCODING_PREFIX}{SCHEMA_PREFIX}/{key.name}_reply/{_REPLY_VERSION}"


def encode_value(key: Key[A, P], payload: P, address: A) -> bytes:
    """JSON bytes of `payload` that every reader can decode, and takes in.

    Raises:
        UndecodablePayload: a field has a value that its type does not allow, or it is too large.
    """
    data = key.check(payload, address)
    if (why := too_long(key, len(data))) is not None:
        raise UndecodablePayload(f"the value for {key.build(address)} cannot be written: {why}")
    return data


def decode_value(key: Key[Any, P], found: Encoded) -> P:
    """The payload in `found`, of the version of `key` or an older one.

    Bytes without a schema in their encoding (somebody put them by hand) are taken at their word.

    Raises:
        UndecodablePayload: another schema, a newer version, or not a payload of this type, or one
            that is too large.
    """
    if (why := too_long(key, len(found.data))) is not None:
        raise UndecodablePayload(f"the value at {found.keyexpr} is not taken in: {why}")
    return _decode(found, key.payload, key.name, key.version)


def decode_reply(key: Key[Any, Any], found: Encoded) -> Payload:
    """The reply in `found`, of type `key.reply`.

    Raises:
        UndecodablePayload: as `decode_value`.
    """
    assert key.reply is not None
    return _decode(found, key.reply, f"{key.name}_reply", _REPLY_VERSION)


def _decode(found: Encoded, kind: type[P], name: str, version: int) -> P:
    _, _, schema = found.encoding.partition(";")
    if schema:
        parts = schema.split("/")
        if len(parts) != 3 or parts[:2] != [SCHEMA_PREFIX, name] or not parts[2].isdecimal():
            raise UndecodablePayload(
                f"the value at {found.keyexpr} says it is {schema!r}, but this key carries "
                f"'{SCHEMA_PREFIX}/{name}/{version}'"
            )
        if int(parts[2]) > version:
            raise UndecodablePayload(
                f"the value at {found.keyexpr} is version {parts[2]} of {name}, but this program "
                f"knows versions up to {version}: update it"
            )
    return decode_payload(kind, found.data, found.keyexpr)
