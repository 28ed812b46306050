"""A verb said once of several things and places: "put the cup on the table, the fork in …"."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from fleet.language.sentences.segments import Segment
from fleet.language.tagging.tagger import Lexeme, Tagger

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
