"""What a store answers, as samples."""

from __future__ import annotations

from base64 import b64decode
from dataclasses import dataclass

from keyexpr_schema.payloads.system import StoreChanges, StoredValue, StoreReplaced
from keyexpr_schema.transport.samples import Sample
from keyexpr_schema.transport.stamps import stamp_of_text


@dataclass(frozen=True)
class Replaced:
    """Whether a key was written by compare-and-set, and what it holds now."""

    done: bool
    there: Sample | None


@dataclass(frozen=True)
class Page:
    """Some of what changed at a store, deletions included; see `payloads.system.StoreChanges`."""

    samples: tuple[Sample, ...]
    position: str
    whole: bool
    more: bool

    @classmethod
    def of(cls, answer: StoreChanges) -> Page:
        """That of an answer."""
        samples = tuple(map(_sample_of, answer.values))
        return cls(samples, answer.position, answer.whole, answer.more)


def _sample_of(value: StoredValue) -> Sample:
    data = value.value or ""
    return Sample(
        value.keyexpr,
        b64decode(data) if value.base64 else data.encode(),
        value.encoding,
        stamp_of_text(value.timestamp),
        value.value is None,
        value.received,
    )


def replaced_sample(keyexpr: str, answer: StoreReplaced) -> Sample | None:
    """What a key holds after it was compared; `None`: nothing."""
    if answer.value is None:
        return None
    stamp = stamp_of_text(answer.timestamp)
    return Sample(keyexpr, answer.value.encode(), answer.encoding, stamp, False)
