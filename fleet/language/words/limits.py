"""How long a text may be that is read at once."""

from __future__ import annotations

from fleet.errors import NotUnderstood
from fleet.language.words.tokens import Token, tokens_of

MOST_CHARACTERS = 8_000
MOST_WORDS = 1_000


def tokens_within_limits(text: str, mode: str) -> tuple[Token, ...]:
    """The words of a text; `mode` as in `Reader`.

    Raises:
        NotUnderstood: it is empty, or too long.
    """
    if len(text) > MOST_CHARACTERS:
        raise NotUnderstood(
            f"the text has {len(text):,} characters, and at most {MOST_CHARACTERS:,} are read "
            "at once: say it in several goals"
        )
    tokens = tokens_of(text)
    if len(tokens) > MOST_WORDS:
        raise NotUnderstood(
            f"the text has {len(tokens):,} words, and at most {MOST_WORDS:,} are read at "
            "once: say it in several goals"
        )
    if not any(token.word[0].isalnum() for token in tokens):
        what = "what holds" if mode == "fact" else "what you want"
        raise NotUnderstood(f"the sentence is empty: say {what}")
    return tokens
