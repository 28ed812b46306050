"""Whom a clause is about: lists of noun phrases, pronouns, and who may be meant at all."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.phrases.cursor import Cursor
from fleet.language.phrases.mentions import Mention, NounPhrase, Quantity
from fleet.language.phrases.noun_phrases import NounPhrases
from fleet.language.refusals import one_of
from fleet.language.vocabulary import Vocabulary
from fleet.language.words.lexicon import EntityType
from fleet.language.words.morphology import participles
from fleet.language.words.wordlists import PLURAL_PRONOUNS, PREPOSITIONS, SINGULAR_PRONOUNS
from keyexpr_schema.facts import AT, FactKey, Literal
from keyexpr_schema.payloads.world import Feature

THINGS: tuple[EntityType, ...] = ("object", "robot")
Subject = NounPhrase | Mention
_AFTER_PRONOUNS = PREPOSITIONS | frozenset({"and", "then", "back", "away", "up", "home", "should"})


def _determined(subject: Subject, before: Subject) -> Subject:
    """The same, with the determiner of the one before if it has none: "all cups and books"."""
    if (
        isinstance(subject, NounPhrase)
        and isinstance(before, NounPhrase)
        and subject.plural
        and subject.quantity is Quantity.BARE
        and subject.count is None
        and before.quantity in (Quantity.ALL, Quantity.THE)
        and before.ordinal is None
    ):
        return replace(subject, quantity=before.quantity)
    return subject


class Subjects:
    """Reads lists of noun phrases, and settles who is meant by them."""

    def __init__(self, cursor: Cursor, nouns: NounPhrases, vocabulary: Vocabulary) -> None:
        self.cursor, self.nouns, self.vocabulary = cursor, nouns, vocabulary
        self.recent: list[Mention] = []  # whom "it" and "them" may mean
        self.presumed: list[Literal] = []

    def read(self, what: str, types: Sequence[EntityType], several: bool = True) -> list[Subject]:
        """One noun phrase or pronoun, or several with commas and "and" between them.

        Raises:
            NotUnderstood: the first is nothing known. A later one that is not ends the list.
        """
        found: list[Subject] = [self._one(what, types)]
        while several:
            start = self.cursor.at
            if self.cursor.take("or"):
                found[-1] = self._either(found[-1], self._one(what, types))
                continue
            if not self.cursor.take_joint() or self.cursor.verb_next() or not self._starts(types):
                self.cursor.at = start
                break
            found.append(_determined(self._one(what, types), found[-1]))
        return found

    def resolve(
        self, subject: Subject, source: str | None = None, surface: str | None = None
    ) -> Mention:
        """Who is meant; with `source`, by those who are believed to be there (on a `surface`).

        Raises:
            NotUnderstood: it does not say which of several, or counts wrongly.
        """
        if isinstance(subject, Mention):
            mention = subject
        elif source is None:
            mention = subject.resolve()
        else:
            mention = self._at_source(subject, source, surface)
        if source is not None and not mention.open:
            self.presumed.extend(Literal(FactKey(AT, name), source) for name in mention.subjects)
        return mention

    def remember(self, mentions: Sequence[Mention]) -> None:
        """These are whom a pronoun means from now on."""
        for mention in mentions:
            self.nouns.mentioned(mention)
        if len(mentions) > 1 and not any(m.open for m in mentions):
            names = tuple(dict.fromkeys(s for m in mentions for s in m.subjects))
            self.recent = [Mention(names, mentions[0].type, mentions[0].key)]
        else:
            self.recent = list(mentions)

    def movable(self, subject: Subject) -> Subject:
        """The same, without what cannot be moved where the words leave that open.

        Raises:
            NotUnderstood: what is named cannot be moved.
        """
        if isinstance(subject, Mention) or subject.type != "object":
            return subject
        things = self.vocabulary.objects.values()
        return self.fit(subject, {o.object for o in things if o.is_a(Feature.MOVABLE)}, "move")

    def fit(self, subject: Subject, able: Collection[str], verb: str) -> Subject:
        """The same, without those that the verb cannot be done to where the words leave that open.

        Raises:
            NotUnderstood: it cannot be done to what is named.
        """
        names = subject.names if isinstance(subject, NounPhrase) else subject.subjects
        if subject.type != "object" or not (others := [n for n in names if n not in able]):
            return subject
        if isinstance(subject, NounPhrase):
            left = subject.among(able)
            if left.found and (subject.generic or subject.quantity is Quantity.ANY):
                return left
        text = subject.text if isinstance(subject, NounPhrase) else self.cursor.line
        done = " ".join([participles(verb.split()[0])[0], *verb.split()[1:]])
        raise NotUnderstood(f"{text!r}: {one_of(others)} cannot be {done}")

    def drivers(self, subject: Subject) -> Subject:
        """The same, with only robots that can drive where the words leave open which robot.

        Raises:
            NotUnderstood: no robot that could be meant can drive.
        """
        if isinstance(subject, Mention) or subject.type != "robot" or subject.exact:
            return subject
        if subject.quantity is not Quantity.ANY and subject.plural:
            return subject
        able = subject.among(self.able_to_drive())
        if not able.found:
            raise NotUnderstood(f"{subject.text!r}: no such robot that can drive is known")
        return able

    def able_to_drive(self) -> list[str]:
        """Robots with the skill to go somewhere."""
        return sorted(n for n, spec in self.vocabulary.robots.items() if "navigate" in spec.skills)

    def some_robot(self) -> Mention:
        """Any robot that can drive, where nobody is named.

        Raises:
            NotUnderstood: there is none.
        """
        able = tuple(self.able_to_drive())
        if not able:
            raise NotUnderstood("no robot that can drive is known yet, so nobody can go anywhere")
        return Mention(able, "robot", self.cursor.at, open=len(able) > 1)

    def pronoun(self) -> Mention | None:
        """Whom the pronoun that comes next means; `None` if none comes.

        Raises:
            NotUnderstood: nobody was spoken of, or it could be several.
        """
        cursor, start = self.cursor, self.cursor.at
        word = cursor.word()
        if word in ("both", "all", "each") and cursor.word(1) == "of":
            ahead = 2
            if cursor.word(2) not in ("them", "these", "those"):
                return None
        elif word in ("it", "them", "they") or (
            word in SINGULAR_PRONOUNS | PLURAL_PRONOUNS and self._alone(1)
        ):
            ahead = 0
        else:
            return None
        cursor.at += ahead + 1
        plural = word in PLURAL_PRONOUNS
        meant = [m for m in self.recent if m.single != plural]
        if len(meant) == 1 and (word != "both" or len(meant[0].subjects) == 2):
            return meant[0]
        names = sorted({s for m in self.recent for s in m.subjects})
        reason = f"could be {one_of(names)}" if names else "refers to nothing before it"
        raise NotUnderstood(f"{cursor.quote(start)!r} {reason}: name what you mean")

    def _alone(self, ahead: int) -> bool:
        """Whether no noun can begin so many words ahead."""
        word = self.cursor.word(ahead)
        return not word or not word[0].isalnum() or word in _AFTER_PRONOUNS

    def _one(self, what: str, types: Sequence[EntityType]) -> Subject:
        mention = self.pronoun()
        return mention if mention is not None else self.nouns.noun(what, types)

    def _starts(self, types: Sequence[EntityType]) -> bool:
        word = self.cursor.word()
        pronoun = word in ("it", "them") and bool(self.recent)
        return pronoun or self.nouns.starts(types)

    def _either(self, first: Subject, second: Subject) -> NounPhrase:
        """ "Cup 1 or cup 2" """
        if not isinstance(first, NounPhrase) or not isinstance(second, NounPhrase):
            raise NotUnderstood('"or" is understood between names only: name both')
        if first.type != second.type or not (first.resolve().single and second.resolve().single):
            raise NotUnderstood(f"{first.text!r} or {second.text!r} leaves too much open")
        both = (
            first.among(first.resolve().subjects).found
            + second.among(second.resolve().subjects).found
        )
        return NounPhrase(both, f"{first.text} or {second.text}", first.key, Quantity.ANY)

    def _at_source(self, noun: NounPhrase, source: str, surface: str | None) -> Mention:
        """Who is meant by "all cups" when it is said that they come from a place."""
        try:
            mention = noun.resolve()
            if not mention.selective:
                return mention
        except NotUnderstood as error:
            reason: str | None = str(error)
        else:
            reason = None
        there = [name for name in noun.names if self.vocabulary.is_at(name, source)]
        if surface is not None:
            there = self._on(surface, there, all_of_them=reason is None and not mention.open)
        if there:
            return replace(noun.among(there).resolve(), key=noun.key)
        where = f"on {surface}" if surface is not None else f"in {source}"
        raise NotUnderstood(
            reason or f"it is not known which of {one_of(noun.names)} are {where}: name them"
        )

    def _on(self, surface: str, there: Sequence[str], all_of_them: bool) -> list[str]:
        """Those that are believed to lie on a surface.

        Raises:
            NotUnderstood: all of them are meant, and of some it is not known what they lie on.
        """
        unsure = [name for name in there if name not in self.vocabulary.rests]
        if unsure and all_of_them:
            raise NotUnderstood(
                f"it is not known whether {one_of(unsure)} lies on {surface}: name the things, or "
                "have the place searched first"
            )
        return [name for name in there if self.vocabulary.rests.get(name) == surface] or unsure
