"""When two spellings are the same word: accents composed or not, wide letters, capitals."""

from __future__ import annotations

import unicodedata

DOTLESS_I, DOT_ABOVE = "\u0131", "\u0307"


def folded(text: str) -> str:
    """`text` as words are compared: by NFKC and case folding (Unicode, section 3.13).

    A Turkish keyboard's dotless and dotted capital i are the letter i.
    """
    if text.isascii():
        return text.lower()
    plain = unicodedata.normalize("NFKC", text).casefold()
    plain = plain.replace(f"i{DOT_ABOVE}", "i").replace(DOTLESS_I, "i")
    return unicodedata.normalize("NFKC", plain)


def composed(text: str) -> tuple[str, list[int] | None]:
    """`text` by NFKC, and for each of its characters and its end where in `text` that began;
    `None` where nothing changed."""
    if unicodedata.is_normalized("NFKC", text):
        return text, None
    parts: list[str] = []
    starts: list[int] = []
    at = 0
    while at < len(text):
        end = at + 1
        while end < len(text) and _joins(text[end]):
            end += 1
        part = unicodedata.normalize("NFKC", text[at:end])
        parts.append(part)
        starts += [at] * len(part)
        at = end
    return "".join(parts), [*starts, len(text)]


def _joins(mark: str) -> bool:
    """Whether a character goes together with the one before it: an accent, part of a syllable."""
    return unicodedata.combining(mark) != 0 or "\u1160" <= mark <= "\u11ff"
