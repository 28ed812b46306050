"""Spellings that are one word: accents composed or not, capitals, dotted and dotless i."""

from __future__ import annotations

import unicodedata

import pytest

from fleet.language.words.folding import composed, folded
from fleet.language.words.tokens import tokens_of, words_of


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("café", unicodedata.normalize("NFD", "CAFÉ")),
        ("Straße", "STRASSE"),
        ("İzmir", "izmir"),
        ("DIŞ KAPI", "d\u0131ş kap\u0131"),
        ("\uff43\uff55\uff50", "cup"),
        ("green", "gr\u200bee\u00adn\ufeff"),
        ("한글", unicodedata.normalize("NFD", "한글")),
    ],
)
def test_they_are_compared_alike(one: str, other: str) -> None:
    assert folded(one) == folded(other)
    assert words_of(one) == words_of(other) != ()


def test_tokens_stand_where_their_letters_stand_in_the_text_as_it_was_said() -> None:
    said = unicodedata.normalize("NFD", "Bring the café's “crème” to the Çat\u0131…")
    found = [(token.word, said[token.start : token.end]) for token in tokens_of(said)]
    assert [word for word, _ in found] == [
        "bring", "the", "café", "'s", "crème", "to", "the", "çati", ","
    ]  # fmt: skip
    assert all(folded(word) in folded(part) for word, part in found if word.isalpha())
    text, starts = composed(said)
    assert text == unicodedata.normalize("NFKC", said)
    assert starts is not None and [*starts] == sorted(starts) and starts[-1] == len(said)
    assert composed("Bring it.") == ("Bring it.", None)
    assert composed("\ufeffgr\u200bee\u0301") == ("greé", [1, 2, 4, 5, 7])
