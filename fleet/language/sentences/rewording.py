"""Sentences in the words in which they are read: without fillers, "if so" as "if"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fleet.language.tagging.tagger import Lexeme

_NAMED = frozenset({"DET", "INDEF", "NOUN"})
_GIVEN = frozenset({"IF", "WHEN", "UNLESS", "WHENEVER", "TIME"})
_ASKED = frozenset({"WHERE", "HOWMANY", "WHICH", "WHAT", "WHO"})
_WISHED = frozenset({"should", "must", "ought", "has", "have", "needs", "need"})


def opened(words: Sequence[Lexeme]) -> Sequence[Lexeme]:
    """Without "actually," and the like, where a sentence begins with them."""
    begun = 0
    while begun + 2 < len(words) and words[begun].tags & {"OPENER", "POLITE"}:
        comma = "COMMA" in words[begun + 1].tags
        if "OPENER" in words[begun].tags and not comma:
            break
        begun += 1 + comma
    return words[begun:]


def marked(words: Sequence[Lexeme]) -> list[Lexeme]:
    """With what stands before "too", or behind "also", marked: "and the fork as well"."""
    found = list(words)
    for i, word in enumerate(words):
        behind = words[i + 1].tags if i + 1 < len(words) else frozenset()
        if word.words == ("too",) and behind & {"NOUN", "ADJ"} and "VERB" not in behind:
            found[i] = replace(word, tags=frozenset({"UNK"}))  # "bring me too apples"
        elif "TOO" in word.tags:
            before = [j for j in range(i) if "COMMA" not in words[j].tags]
            follows = i + 1 < len(words) and not words[i + 1].tags & {"COMMA", "END", "AND"}
            opens = not before or words[i - 1].tags & {"AND", "COMMA", "THEN", "POLITE"}
            at = i + 1 if follows and opens else before[-1] if before else i
            found[at] = replace(words[at], tags=words[at].tags | {"TOO"})
    return found


def without_fillers(words: Sequence[Lexeme]) -> list[Lexeme]:
    """Without "go" before another verb ("go wash it"), and "either" before "or"."""
    kept: list[Lexeme] = []
    verbs = sum("VERB" in each.tags for each in words)
    for i, word in enumerate(words):
        following = words[i + 1].tags if i + 1 < len(words) else frozenset()
        if word.words == ("instead",) and i == len(words) - 1 and verbs > 1:
            continue  # "turn off the radio and turn on the TV instead"
        goes = word.words in (("go",), ("come",)) and "VERB" in following
        if word.words == ("but",) and kept and following & {"DONT", "NEVER", "AVOID"}:
            word = replace(word, tags=frozenset({"AND"}))
        if word.words == ("but",) and kept and "VERB" in following and "NOUN" not in following:
            word = replace(word, tags=frozenset({"AND"}))  # "but close the fridge afterwards"
        if (
            "ONLY" in word.tags
            and following & _NAMED
            and any("VERB" in w.tags for w in kept)
            and (not any(w.tags & {"NEVER", "DONT", *_GIVEN} for w in words))
        ):
            continue  # "bring only the red apples"
        if word.words == ("else",) and kept and "EVERYTHING" in kept[-1].tags:
            continue
        whole = kept and not kept[-1].tags & {"PREP", "AND", "VERB"}
        if word.words == ("each",) and whole and ("INDEF" in following or i == len(words) - 1):
            continue  # "Ben and Lily each an apple"
        behind = words[i + 2].tags if i + 2 < len(words) else frozenset()
        if word.words == ("and",) and kept and "NOT" in following and behind & _NAMED:
            continue  # "apple 1 and not apple 2"
        if goes and not following & {"NOUN", "PREP", "PARTICLE"}:
            continue
        if "EITHER" in word.tags and any("OR" in later.tags for later in words[i + 1 :]):
            continue
        kept.append(word)
    return kept


def if_so(words: list[Lexeme]) -> list[Lexeme]:
    """`check whether it is on, and if so turn it off` as `if it is on, turn it off`."""
    so = ("IF", "PRON", "BE", "COMMA")
    so_not = ("IF", "PRON", "BE", "NOT", "COMMA")
    nots: list[Lexeme] = []
    for i in range(2, len(words) - len(so)):  # "…, and if it is, turn it off"
        said = next((s for s in (so, so_not) if _begins(words[i:], s)), None)
        if said is not None:
            so_is = replace(words[i], tags=frozenset({"IFSO"}))
            nots = words[i + 3 : i + 4] if said is so_not else []
            words = [*words[:i], so_is, *words[i + len(said) :]]
            break
    at = next((i for i, word in enumerate(words) if "IFSO" in word.tags), None)
    whether = len(words) > 2 and (words[1].tags & {"IF", "WHETHER"} or words[1].words == ("that",))
    if at is None or not whether or "ASK" not in words[0].tags or not words[at + 1 :]:
        return words
    inner = [w for w in words[2:at] if "COMMA" not in w.tags]
    inner = inner[:-1] if inner and "AND" in inner[-1].tags else inner
    be = next((i for i, word in enumerate(inner) if "BE" in word.tags), len(inner) - 1)
    inner = [*inner[: be + 1], *nots, *inner[be + 1 :]]
    comma = replace(words[at], tags=frozenset({"COMMA"}))
    return [replace(words[1], tags=frozenset({"IF"})), *inner, comma, *commas(words[at + 1 :])]


def _begins(words: Sequence[Lexeme], tags: Sequence[str]) -> bool:
    following = words[: len(tags)]
    return len(following) == len(tags) and all(
        tag in word.tags for tag, word in zip(tags, following, strict=True)
    )


def carried_on(words: list[Lexeme]) -> list[Lexeme]:
    """With "brings" as what is asked for as well in "picker 1 scans it and then brings it"."""
    found = list(words)
    for i, word in enumerate(words):
        joined = i > 1 and words[i - 1].tags & {"AND", "THEN"}
        alone = "FIN" in word.tags and not word.tags & {"VERB", "NOUN"}
        if joined and alone and any("FIN" in w.tags for w in words[:i] if "VERB" not in w.tags):
            found[i] = replace(word, tags=word.tags | {"VERB"})
    return found


def thought(words: list[Lexeme]) -> list[Lexeme]:
    """Without "I think" before what should be; before what is so, it is a guess."""
    if words and "THINK" in words[0].tags:
        wished = any(w.tags & {"MODAL"} and w.words[0] in _WISHED for w in words)
        return words[1:] if wished else [
            replace(words[0], words=words[0].words[1:2], tags=frozenset({"UNK"})), *words[1:]
        ]  # fmt: skip
    return words


def asked(words: list[Lexeme]) -> list[Lexeme]:
    """Without "tell me" and the like before a question, and with "tell me if" as one."""
    if len(words) > 2 and "TAG" in words[-1].tags and "COMMA" in words[-2].tags:
        words = [replace(words[-1], tags=frozenset({"ASKIF"})), *words[:-2]]  # "…, isn't it?"
    if len(words) > 3 and words[0].words == ("find", "out") and "WHERE" in words[1].tags:
        be = next((i for i, word in enumerate(words) if i > 2 and "BE" in word.tags), None)
        find = replace(words[0], words=("find",), tags=frozenset({"VERB"}))
        if be is not None:  # "find out where the novel is and bring it to me"
            return [find, *words[2:be], *words[be + 1 :]]
    kept: list[Lexeme] = []
    for i, word in enumerate(words):
        following = words[i + 1].tags if i + 1 < len(words) else frozenset()
        if "ASK" in word.tags and following & {"IF", "WHETHER"}:
            kept.append(replace(words[i + 1], tags=frozenset({"ASKIF"})))
        elif (
            kept
            and kept[-1] is not word
            and "ASK" in words[i - 1].tags
            and word.tags & {"IF", "WHETHER"}
        ):
            continue
        elif not ("ASK" in word.tags and following & _ASKED):
            kept.append(word)
    return kept


def commas(words: Sequence[Lexeme]) -> list[Lexeme]:
    """Without commas at the ends, and of several in a row one."""
    kept: list[Lexeme] = []
    for word in words:
        if "COMMA" not in word.tags or (kept and "COMMA" not in kept[-1].tags):
            kept.append(word)
    while kept and "COMMA" in kept[-1].tags:
        kept.pop()
    return kept
