"""What travels beside a value: how long it was held back, and who has signed it.

Stores keep no attachments, and what one says counts only where something is taken in.
"""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from collections.abc import Callable
from typing import NamedTuple

_TEXT = re.compile(
    r"(?:late (?P<late_us>[0-9]{1,18}))?(?: ?signed (?P<by>[\w+/=]+) (?P<certificate>[\w+/=]+))?",
    re.ASCII,
)
LONGEST = 8_192
"""Bytes of an attachment that is looked at: a certificate takes less than a thousand, that of a
router as much more as it has names."""


class Signature(NamedTuple):
    """A signature, and the certificate (X.509, DER) of the key that it is by."""

    value: bytes
    certificate: bytes


class Attachment(NamedTuple):
    """`late_us`: how long its writer has held it back [µs]; `None`: it does not say."""

    late_us: int | None = None
    signature: Signature | None = None

    @property
    def size(self) -> int:
        """Bytes of what is signed with."""
        return 0 if self.signature is None else sum(map(len, self.signature))

    def text(self) -> str | None:
        """As it travels; `None`: there is nothing to say."""
        late = "" if self.late_us is None else f"late {self.late_us}"
        if self.signature is None:
            return late or None
        parts = (b64encode(part).decode() for part in self.signature)
        return " ".join(filter(None, (late, "signed", *parts)))

    @classmethod
    def read(cls, data: bytes) -> Attachment:
        """What somebody has attached; what means nothing to us says nothing."""
        if not data or len(data) > LONGEST:
            return cls()
        try:
            found = _TEXT.fullmatch(data.decode("ascii"))
            if found is None:
                return cls()
            late_us, value, certificate = found.groups()
            signature = value and Signature(
                b64decode(value, validate=True), b64decode(certificate, validate=True)
            )
        except ValueError:
            return cls()
        return cls(None if late_us is None else int(late_us), signature or None)


Attach = Callable[[str, str, bytes | None, int | None], str | None]
"""What goes beside a value: from its key expression, its stamp as text, its bytes (`None`: it is a
deletion), and how long it was held back [µs], if that is to be said."""


def unsigned(_: str, __: str, ___: bytes | None, late_us: int | None) -> str | None:
    """What those attach who have no certificate."""
    return Attachment(late_us).text()
