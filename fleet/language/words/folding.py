"""When two spellings are the same word: accents composed or not, wide letters, capitals."""

from __future__ import annotations

import re
import unicodedata

DOTLESS_I, DOT_ABOVE = "\u0131", "\u0307"
_UNSEEN = re.compile("[\u00ad\u034f\u061c\u200b-\u200f\u2060-\u2064\ufe00-\ufe0f\ufeff]")
"""Of Unicode's default ignorable characters those that get into what people type and copy."""


def folded(text: str) -> str:
    """`text` as words are compared: by NFKC and case folding (Unicode, section 3.13).

    A Turkish keyboard's dotless and dotted capital i are the letter i; what is not seen, such as a
    space of no width, is not there.
    """
    if text.isascii():
        return text.lower()
    plain = unicodedata.normalize("NFKC", _UNSEEN.sub("", text)).casefold()
    plain = plain.replace(f"i{DOT_ABOVE}", "i").replace(DOTLESS_I, "i")
    return unicodedata.normalize("NFKC", plain)


def composed(text: str) -> tuple[str, list[int] | None]:
    """`text` by NFKC without what is not seen, and for each of its characters and its end where in
    `text` that began; `None` where nothing changed."""
    if unicodedata.is_normalized("NFKC", text) and not _UNSEEN.search(text):
        return text, None
    parts: list[str] = []
    starts: list[int] = []
    at = 0
    while at < len(text):
        end = at + 1
        while end < len(text) and _joins(text[end]):
            end += 1
        part = unicodedata.normalize("NFKC", _UNSEEN.sub("", text[at:end]))
        parts.append(part)
        starts += [at] * len(part)
        at = end
    return "".join(parts), [*starts, len(text)]


def _joins(mark: str) -> bool:
    """Whether a character goes together with the one before it: an accent, part of a syllable."""
    joined = unicodedata.combining(mark) != 0 or "\u1160" <= mark <= "\u11ff"
    return joined or _UNSEEN.match(mark) is not None
