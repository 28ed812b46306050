"""Other words in which a condition is read: as a question, without "not", one of several."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from fleet.language.sentences.segments import Segment, Sentence
from fleet.language.tagging.tagger import Lexeme

_AUXILIARY = frozenset({"BE", "HAVE", "MODAL", "DO", "WAS"})
_FINITE = frozenset({"BE", "HAVE"})
_WHO = frozenset({"NOBODY", "ANYONE", "NOTHING", "SOMETHING"})
_FOUND = frozenset({("found",), ("located",), ("to", "be", "found")})


def in_other_words(segment: Segment) -> Iterator[Segment]:
    """How a condition can be read that is not read as it is: as a question, and without "not"."""
    without = _affirmed(segment)
    yield from filter(None, (_asked(segment), _found(segment)))
    if without is not None:
        yield from filter(None, (_asked(without), _found(without), without))


def alternatives(segment: Segment) -> tuple[Segment, ...]:
    """The conditions of which one is enough: "the front door or the garage door is open".

    None, if it does not say several.
    """
    words = [word for word in segment.words if "EITHER" not in word.tags or "NOUN" in word.tags]
    at = next((i for i, word in enumerate(words) if "OR" in word.tags), None)
    if at is None:
        return ()
    before, after = words[:at], words[at + 1 :]
    begins = next((i for i, word in enumerate(before) if word.tags & _FINITE), None)
    ends = next((i for i, word in enumerate(after) if word.tags & _FINITE), None)
    if begins is None and ends is not None:  # "the front door or the garage door is open"
        before = [*before, *after[ends:]]
    elif begins is not None and ends is None:  # "the cup is in the kitchen or the hall"
        shared = before[: begins + 1]
        place = [i for i, word in enumerate(before) if "PREP" in word.tags and i > begins]
        if place and not after[0].tags & {"PREP", "ADJ", "PART"}:
            shared = before[: place[-1] + 1]
        after = [*shared, *after]
    elif begins is None:
        return ()
    first, second = (replace(segment, words=tuple(part)) for part in (before, after))
    return (first, *(alternatives(second) or (second,)))


def apart(sentence: Sentence) -> list[Sentence]:
    """The sentence for each of its alternatives, where what is done then is another thing for each:
    "whenever the front door or the garage door is open, close it"."""
    given = [i for i, part in enumerate(sentence.segments) if part.role]
    rest = [part for part in sentence.segments if not part.role]
    if len(given) != 1 or not rest:
        return [sentence]
    found = alternatives(sentence.segments[given[0]])
    pronouns = any("PRON" in word.tags for part in rest for word in part.words)
    whenever = sentence.segments[given[0]].role == "whenever"
    if not found or not (whenever or pronouns) or sentence.segments[given[0]].role == "unless":
        return [sentence]
    return [
        replace(
            sentence,
            segments=(*sentence.segments[: given[0]], one, *sentence.segments[given[0] + 1 :]),
            once_more=bool(number),
        )
        for number, one in enumerate(found)
    ]


def _affirmed(segment: Segment) -> Segment | None:
    """The same without its one negation: "the cup is not in the kitchen" as "is in the kitchen"."""
    words: list[Lexeme] = []
    count = 0
    for i, word in enumerate(segment.words):
        before = segment.words[i - 1].tags if i else frozenset()
        if "NOT" in word.tags and (before & _AUXILIARY or not i):
            count += 1
            if "MODAL" in before:
                words.pop()  # "if you cannot find it"
        elif "DONT" in word.tags and "PEOPLE" in before:
            count += 1
        elif "NONE" in word.tags and "BE" in before:
            count += 1
            words.append(replace(word, words=("a",), tags=frozenset({"INDEF"})))
        else:
            words.append(word)
    return replace(segment, words=tuple(words), negated=True) if count == 1 else None


def _asked(segment: Segment) -> Segment | None:
    """`there is a cup in the kitchen`, `nobody is in the kitchen` as the question whether it is."""
    words = segment.words
    if len(words) < 3:
        return None
    there = "THERE" in words[0].tags and "BE" in words[1].tags
    whom = words[2] if there else words[0]
    be = words[1]
    is_ = replace(be, words=("is",), tags=frozenset({"ISARE"}))
    if whom.tags & _WHO and "BE" in be.tags and "NOUN" not in whom.tags:
        none = bool(whom.tags & {"NOBODY", "NOTHING"})
        rest = words[3:] if there else words[2:]
        somebody: tuple[Lexeme, ...]
        if whom.words == ("no", "robot"):
            somebody = (
                replace(whom, words=("a",), tags=frozenset({"INDEF"})),
                replace(whom, words=("robot",), tags=frozenset({"NOUN"})),
            )
        else:
            thing = bool(whom.tags & {"NOTHING", "SOMETHING"})
            tag, called = ("SOMETHING", "anything") if thing else ("ANYONE", "anyone")
            somebody = (replace(whom, words=(called,), tags=frozenset({tag})),)
        there_ = replace(be, words=("there",), tags=frozenset({"THERE"}))
        negated = segment.negated is not none
        return replace(segment, words=(is_, there_, *somebody, *rest), negated=negated)
    return replace(segment, words=(is_, words[0], *words[2:])) if there else None


def _found(segment: Segment) -> Segment | None:
    """`the cup has been found` as what holds where it is not so that "the cup is lost"."""
    words = segment.words
    being = {"BE", "HAVE", "WAS", "BEEN"}
    begins = next((i for i, word in enumerate(words) if word.tags & being), 0)
    if not begins or words[-1].words not in _FOUND:
        return None
    if any(not word.tags & being for word in words[begins:-1]):
        return None
    is_ = replace(words[-1], words=("is",), tags=frozenset({"BE"}))
    lost = replace(words[-1], words=("lost",), tags=frozenset({"UNKNOWN"}))
    return replace(segment, words=(*words[:begins], is_, lost), negated=not segment.negated)
