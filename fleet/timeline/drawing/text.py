"""Text that Rerun's viewer can draw.

Rerun 0.41 brings one font (Inter). Drawn without a screen, the viewer does not put a box for a
glyph that it lacks: it ends. So what is written into a recording to be looked at is kept to
characters that were all tried. The keys still hold every text as it was written.
"""

from __future__ import annotations

import unicodedata

SYMBOLS = "“”‘’„–—…·•«»‹›€←→↑↓↔⇒✓✔✗×▶►●○■□∅≤≥≠≈±°²³½µ−∞√∑∆◆★☆⚠"  # noqa: RUF001

DRAWN = frozenset(
    [
        *map(chr, range(0x20, 0x7F)),
        *map(chr, range(0xA1, 0x180)),  # Latin with accents
        *map(chr, range(0x391, 0x3CA)),  # Greek
        *map(chr, range(0x401, 0x460)),  # Cyrillic
        *SYMBOLS,
        "\n",
    ]
) - {"\xad", "\u0149", "\u03a2"}
"""Characters that the viewer's font has."""

MISSING = "?"
_NOT_TEXT = frozenset({"Mn", "Cf"})


def drawable(text: str) -> str:
    """`text` with what the viewer cannot draw replaced: by a plainer letter, or by `?`."""
    if DRAWN.issuperset(text):
        return text
    return "".join(map(_drawable, unicodedata.normalize("NFC", text)))


def _drawable(char: str) -> str:
    if char in DRAWN:
        return char
    if char.isspace() or unicodedata.category(char) == "Cc":
        return " "
    plain = "".join(
        part
        for part in unicodedata.normalize("NFKD", char)
        if unicodedata.category(part) not in _NOT_TEXT
    )
    return plain if plain == "" or DRAWN.issuperset(plain) else MISSING
