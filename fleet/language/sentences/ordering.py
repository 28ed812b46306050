"""What comes first: "A before B", "after B, A", "A, but first B"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.language.sentences.rewording import commas
from fleet.language.tagging.tagger import Lexeme


def ordered(words: Sequence[Lexeme]) -> list[Lexeme]:
    """With "A before B" and "after B, A" as "A then B", where a clause follows those words."""
    for i, word in enumerate(words):
        if word.words == ("but",) and (sooner := _sooner(words[i + 1 :])):
            return [*commas(words[:i]), replace(word, tags=frozenset({"SOONER"})), *sooner]
        tag = next((tag for tag in ("BEFORE", "AFTER", "WHEN") if tag in word.tags), None)
        rest = list(words[i + 1 :])
        if tag is None or not rest or not _happens(rest, by_you=tag == "WHEN"):
            continue
        then = replace(word, tags=frozenset({"THEN"}))
        if i:
            first, rest = commas(words[:i]), _deed(rest)
            earlier = replace(word, tags=frozenset({"SOONER"}))
            return [*first, then if tag == "BEFORE" else earlier, *rest]
        ends = [j for j, w in enumerate(rest) if "COMMA" in w.tags]
        verbs = [
            j
            for j, w in enumerate(rest)
            if j > 1 and "VERB" in w.tags and not w.tags & {"NOUN", "ADJ"}
        ]
        if not ends and (not verbs or "PEOPLE" in rest[0].tags):
            return list(words)
        inner = _deed(rest[: ends[0]] if ends else rest[: verbs[0]])
        outer = rest[ends[0] + 1 :] if ends else rest[verbs[0] :]
        return [*outer, then, *inner] if tag == "BEFORE" else [*inner, then, *outer]
    return list(words)


def _sooner(words: Sequence[Lexeme]) -> list[Lexeme]:
    """What is to be done first: "but close the door first", "but first close the door"."""
    begins = [i for i in (0, len(words) - 1) if words and words[i].words == ("1st",)]
    kept = [word for i, word in enumerate(words) if i not in begins]
    return kept if begins and kept and kept[0].tags & {"VERB"} else []


def _deed(words: Sequence[Lexeme]) -> list[Lexeme]:
    """What is to be done, of "you have washed the pan"."""
    left = list(words)
    if not left or "PEOPLE" not in left[0].tags:
        return left
    left = left[1:] if len(left) > 1 and left[1].tags & {"HAVE"} else left
    if left[0].tags & {"HAVE"} and len(left) > 1 and "PART" in left[1].tags:
        return [replace(left[1], tags=left[1].tags | {"VERB"}), *left[2:]]
    return list(words)


def _happens(words: Sequence[Lexeme], by_you: bool = False) -> bool:
    """Whether what follows "before" is something that somebody does.

    `by_you`: only what whoever is spoken to does; else it is what must be so before it is begun.
    """
    if by_you:
        return len(words) > 2 and words[0].words == ("you",) and bool(
            words[1].tags & {"HAVE", "VERB"}
        )  # fmt: skip
    if "PEOPLE" in words[0].tags:
        return len(words) > 1 and bool(words[1].tags & {"VERB", "HAVE"})
    return "GER" in words[0].tags
