"""Who is meant: of those that a noun phrase can mean, told apart by where they are."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject
from fleet.language.resolve.scene import Scene
from fleet.language.tree.nodes import (
    Quantity,
)
from keyexpr_schema.facts import (
    AT,
    FactKey,
    Literal,
)


class Referents:
    """Finds out who is meant by a noun phrase, and whether it can be meant at all."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def resolve(
        self, subject: Subject, source: str | None = None, surface: str | None = None
    ) -> Mention:
        """Who is meant; with `source`, by those who are believed to be there (on a `surface`).

        Raises:
            NotUnderstood: it does not say which of several, or counts wrongly.
        """
        if isinstance(subject, Mention):
            mention = subject
        else:
            if subject.source is not None:
                source, surface = subject.source, subject.source_surface
            if source is not None and subject.wider:  # "go to the hall. Close the window in …"
                is_at = self.scene.vocabulary.is_at
                if not any(is_at(name, source) for name in subject.names):
                    subject = replace(subject, found=subject.wider)
            mention = subject.resolve() if source is None else self._at(subject, source, surface)
        if source is not None and not mention.open:
            self._check_fixed(mention, source)
            self.scene.said.presumed.extend(
                Literal(FactKey(AT, name), source) for name in mention.subjects
            )
        return mention

    def _check_fixed(self, mention: Mention, source: str) -> None:
        """Whether what stays where it is can be there: "the tv in the bedroom".

        Raises:
            NotUnderstood: it is known to be elsewhere.
        """
        vocabulary = self.scene.vocabulary
        for name in mention.subjects:
            place = vocabulary.place_of(name)
            fixed = name in vocabulary.objects and name not in vocabulary.movable
            fixed = fixed and not vocabulary.is_person(name)
            if fixed and place is not None and not vocabulary.is_at(name, source):
                raise NotUnderstood(f"{name} is in {place}, and not in {source}: say which it is")

    def all_of(self, subjects: Sequence[Subject]) -> list[str]:
        """The names of all who are meant.

        Raises:
            NotUnderstood: one of them does not say which of several, or counts wrongly.
        """
        return [name for subject in subjects for name in self.resolve(subject).subjects]

    def _at(self, noun: NounPhrase, source: str, surface: str | None) -> Mention:
        """Who is meant by "all cups" when it is said that they come from a place."""
        try:
            mention = noun.resolve()
            if not mention.selective:
                return mention
        except NotUnderstood as error:
            reason: str | None = str(error)
        else:
            reason = None
        there = [name for name in noun.names if self.scene.vocabulary.is_at(name, source)]
        if surface is not None:
            there = self._on(surface, there, all_of_them=reason is None and not mention.open)
        if there:
            return replace(noun.among(there).resolve(), key=noun.key)
        where = f"on {surface}" if surface is not None else f"in {source}"
        raise NotUnderstood(
            reason or f"it is not known which of {one_of(noun.names)} are {where}: name them"
        )

    def _on(self, surface: str, there: Sequence[str], all_of_them: bool) -> list[str]:
        unsure = [name for name in there if name not in self.scene.vocabulary.rests]
        if unsure and all_of_them:
            raise NotUnderstood(
                f"it is not known whether {one_of(unsure)} lies on {surface}: name the things, or "
                "have the place searched first"
            )
        return [
            name for name in there if self.scene.vocabulary.rests.get(name) == surface
        ] or unsure

    def movable(self, subject: Subject) -> Subject:
        """The same, without what cannot be moved where the words leave that open.

        Raises:
            NotUnderstood: what is named cannot be moved.
        """
        if subject.type != "object":
            return subject
        return self.fit(subject, self.scene.vocabulary.movable, "moved")

    def fit(self, subject: Subject, able: Collection[str], done: str) -> Subject:
        """The same, without those that cannot be `done` where the words leave that open.

        Raises:
            NotUnderstood: it cannot be done to what is named.
        """
        if isinstance(subject, NounPhrase) and subject.wider:
            wider = tuple(e for e in subject.wider if e.stands_for in able)
            subject = replace(subject, wider=wider)
        if subject.type != "object" or not (others := [n for n in subject.names if n not in able]):
            return subject
        if isinstance(subject, NounPhrase):
            left = subject.among(able)
            if left.found and (subject.generic or subject.quantity is Quantity.ANY):
                return left
        named = f"{subject.text!r}: " if isinstance(subject, NounPhrase) else ""
        raise NotUnderstood(f"{named}{one_of(others)} cannot be {done}")

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
        return sorted(
            n for n, spec in self.scene.vocabulary.robots.items() if "navigate" in spec.skills
        )

    def some_robot(self) -> Mention:
        """Any robot that can drive, where nobody is named.

        Raises:
            NotUnderstood: there is none.
        """
        able = tuple(self.able_to_drive())
        if not able:
            raise NotUnderstood("no robot that can drive is known yet, so nobody can go anywhere")
        return Mention(able, "robot", self.scene.said.ended, open=len(able) > 1)

    def check_robots(self, who: Sequence[Subject]) -> None:
        """Whether only robots are told to do something."""
        for subject in who:
            if subject.type != "robot":
                shown = subject.text if isinstance(subject, NounPhrase) else subject.subjects[0]
                raise NotUnderstood(f"{shown!r}: only robots do something")

    @staticmethod
    def any_robot(subject: Subject) -> bool:
        """Whether it leaves open which robot."""
        return (
            isinstance(subject, NounPhrase)
            and subject.generic
            and subject.count is None
            and subject.source is None
        )

    def check_who(self, who: Sequence[Subject]) -> None:
        """Whether it can be said who does it.

        Raises:
            NotUnderstood: one robot of several is named.
        """
        self.check_robots(who)
        for subject in who:
            names = subject.names
            if not self.any_robot(subject) and len(self.scene.vocabulary.robots) > 1:
                if self.scene.mode != "goal":
                    mention = self.resolve(subject)
                    if not (mention.open and set(names) == set(self.scene.vocabulary.robots)):
                        draft = self.scene.said.draft
                        draft.by = tuple(dict.fromkeys((*draft.by, *mention.subjects)))
                    continue
                raise NotUnderstood(
                    f"{' and '.join(names)} cannot be told to do it: a goal says what must hold, "
                    "and the allocator finds who does it; leave the name out"
                )
