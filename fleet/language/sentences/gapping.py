"""A verb said once of several things and places: "put the cup on the table, the fork in …"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from fleet.language.sentences.segments import Segment
from fleet.language.tagging.tagger import Lexeme, Tagger

_ALONE = frozenset({"go", "tidy", "search", "patrol", "clear"})
"""What verbs ask for that need no object."""
_OBJECTS = frozenset({"DET", "INDEF", "UNIV", "NOUN", "NUM", "PRON", "ADJ", "PARTICLE"})
_PAIRS = 3
"""Of fewer, all that they can mean is read at once."""
_NEVER_IN_PAIRS = frozenset({"REL", "BE", "MODAL", "NOT", "EXCEPT", "OR", "NEVER", "SAME", "HOME"})


def gapped(segment: Segment, tagger: Tagger) -> Iterator[Segment]:
    """A segment cut between its pairs, if it puts things somewhere and is nothing but such pairs.

    A chart of all that such a list could mean grows faster than the list.
    """
    words = segment.words
    heads = tagger.verbs.heads(words[0].words, "VERB")
    puts = any("put" in entry.senses for head in heads for entry in tagger.verbs.entries[head])
    pairs = _pairs(words) if puts and not segment.role and not segment.always else []
    if len(pairs) < _PAIRS:
        yield segment
        return
    for number, pair in enumerate(pairs):
        yield replace(segment, words=tuple(pair), joint="and" if number else segment.joint)


def shared(segments: Sequence[Segment], tagger: Tagger) -> list[Segment]:
    """With what several verbs say once said of each: "wash, fold and put away the shirt".

    The first of them is said of it, and the others of the same; where more follows that only goes
    with the last ("wash and put the plates in the cupboard"), that one comes first.
    """
    found: list[Segment] = []
    waiting: list[Segment] = []
    for segment in (part for whole in segments for part in _verbs(whole, tagger)):
        begins = _bare_verb(segment.words, tagger)
        apart = segment.role or segment.always or segment.joint not in ("", "and")
        if apart and waiting:
            found, waiting = [*found, *waiting], []
        if (
            begins is not None
            and not segment.role
            and not segment.always
            and (not waiting or not begins)
        ):
            waiting.append(segment)
        elif waiting and "VERB" in segment.words[0].tags:
            found, waiting = [*found, *_each_said(waiting, segment, tagger)], []
        else:
            found, waiting = [*found, *waiting, segment], []
    return [*found, *waiting]


def _each_said(waiting: Sequence[Segment], last: Segment, tagger: Tagger) -> Iterator[Segment]:
    at = 1
    while at < len(last.words) - 1 and "PARTICLE" in last.words[at].tags:
        at += 1
    first, more = waiting[0], any(word.tags & {"PREP", "ME"} for word in last.words[at:])
    begins = _bare_verb(first.words, tagger) or 0
    verbs = [each.words[_bare_verb(each.words, tagger) or 0 :] for each in waiting]
    if more:
        yield replace(first, words=(*first.words[:begins], *last.words))
        rest = verbs
    else:
        yield replace(first, words=(*first.words, *last.words[at:]))
        rest = [*verbs[1:], last.words[:at]]
    for verb in rest:
        same = replace(verb[-1], words=("the same",), tags=frozenset({"PRON"}))
        yield replace(last, words=(*verb, same), joint="and")


def _verbs(segment: Segment, tagger: Tagger) -> Iterator[Segment]:
    """`vacuum and mop the kitchen` cut before its last verb."""
    words = segment.words
    for i in range(1, len(words) - 2):
        joined = words[i].tags & {"AND", "COMMA"} and words[i - 1].tags & {"VERB", "PARTICLE"}
        verbal = "VERB" in words[i + 1].tags and words[i + 2].tags & _OBJECTS
        if joined and verbal and _bare_verb(words[:i], tagger) is not None:
            yield replace(segment, words=words[:i])
            yield replace(segment, words=words[i + 1 :], joint="and")
            return
    yield segment


def _bare_verb(words: Sequence[Lexeme], tagger: Tagger) -> int | None:
    """Where the verb begins, of a clause that ends with one that needs an object: "Rosie, wash"."""
    end = len(words)
    while end > 1 and "PARTICLE" in words[end - 1].tags and "VERB" not in words[end - 1].tags:
        end -= 1
    verb = words[end - 1]
    before = words[: end - 1]
    if "VERB" not in verb.tags or any("VERB" in w.tags and "CAUSE" not in w.tags for w in before):
        return None
    if before and not before[-1].tags & {"COMMA", "TO", "MODAL"} and "NOUN" not in before[-1].tags:
        return None
    particles = tuple(word.words for word in words[end:])
    heads = tagger.verbs.heads(verb.words, "VERB")
    entries = [e for h in heads for e in tagger.verbs.entries[h] if e.behind == particles]
    phrases = [p.phrase for h in heads for p in tagger.verbs.skills.get((h, particles), [])]
    alone = any(e.senses & _ALONE for e in entries) and verb.words[0] not in ("put", "stow")
    alone = alone or any(phrase.type == "robot" for phrase in phrases)
    return None if not entries or alone else end - 1


def _pairs(words: Sequence[Lexeme]) -> list[list[Lexeme]]:
    """What stands between "and" and commas, each with one phrase of place; else nothing."""
    pairs: list[list[Lexeme]] = [[]]
    for word in words:
        if word.tags & {"AND", "COMMA"}:
            placed = [i for i, each in enumerate(pairs[-1]) if _prepositional(each)]
            if placed and placed[-1] < len(pairs[-1]) - 1:
                pairs.append([])
            elif pairs[-1]:  # "the cup and the fork on the table"
                pairs[-1].append(word)
        else:
            pairs[-1].append(word)
    fit = all(
        sum(map(_prepositional, pair)) == 1
        and not _prepositional(pair[0])
        and not _prepositional(pair[-1])
        and not any(w.tags & _NEVER_IN_PAIRS and "NOUN" not in w.tags for w in pair)
        for pair in pairs
    )
    return pairs if fit else []


def _prepositional(word: Lexeme) -> bool:
    return "PREP" in word.tags and "NOUN" not in word.tags
