"""Clauses that ask for what a skill does: "vacuum the hallway", "switch the lamp off"."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, one_of
from fleet.language.resolve.frames import Frame
from fleet.language.resolve.goals.tools import Tools
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.location.places import WHERE
from fleet.language.resolve.reference.lists import with_sources
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject
from fleet.language.tagging.skill_words import SkillFrame
from fleet.language.tree.nodes import Place, Quantity
from fleet.language.vocabulary import SkillPhrase
from fleet.language.words.morphology import participles
from keyexpr_schema.facts import (
    Value,
)
from keyexpr_schema.payloads.world import Feature


class Skilled:
    """Turns clauses that ask for a skill into wishes."""

    def __init__(self, ground: Ground) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.tools = Tools(ground)

    def skill(
        self, frame: Frame, frames: Sequence[SkillFrame], who: Sequence[Subject] | None = None
    ) -> None:
        """`vacuum the hallway and the kitchen`, `switch the lamp off`.

        Raises:
            NotUnderstood: it cannot be done to what is named; of several skills of that name, the
                first says why.
        """
        frame, taken = self.tools.taken(frame, frames)
        if taken[0][0].type != "place":
            frame = with_sources(frame)
        themes = frame.themes
        if not themes and frames[0].phrase.type == "place":  # "vacuum in the kitchen"
            inside = [p for p in frame.places[:1] if p.role == "in"]
            themes = tuple(p.nouns for p in inside if p.nouns is not None)
        house = next((p for p in frame.places if p.special == "house"), None)
        places = frame.places if frame.themes else frame.places[1:]
        phrases = [phrase for phrase, _ in taken]
        phrase, besides = taken[0]
        if phrase.type == "robot":
            return self._done_by(frame, phrase, who)
        if phrase.type == "place":
            if house is not None:
                names = self.places.places(house)
                mentions = [Mention((name,), "place", self.scene.said.began) for name in names]
                return self.wish(mentions, (*phrase.wants, *besides))
            self._check_all_said(frame, places)
            if len(themes) != 1:
                known = listed(self.scene.lexicon.known(("place",)))
                raise NotUnderstood(
                    f"{self.scene.said.clause!r} ends where a place is missing; known are {known}"
                )
            named = self.places.place_mentions(themes[0])
            places_ = self.scene.vocabulary.places
            if strange := [n for m in named for n in m.subjects if n not in places_]:
                shown = listed(self.scene.lexicon.known(("place",)))
                raise NotUnderstood(
                    f"{one_of(strange)} is no place: say which place to {phrase.verb}; "
                    f"known are {shown}"
                )
            each = dict.fromkeys(name for m in named for name in m.subjects)
            self.scene.said.rooms = tuple(each)
            self.scene.said.last_place = next(iter(each)) if len(each) == 1 else None
            return self.wish(
                [Mention((n,), "place", self.scene.said.began) for n in each],
                (*phrase.wants, *besides),
            )
        if len(themes) != 1:
            known = listed(self.scene.lexicon.known(("object",)))
            raise NotUnderstood(
                f"{self.scene.said.clause!r} ends where an object is missing; known are {known}"
            )
        able = {
            o.object
            for o in self.scene.vocabulary.objects.values()
            if any(p.fits(o) for p in phrases)
        }
        said, can = self.scene.said, {*able, *self.nouns.parts.able(able)}
        its = {noun.first: self.nouns.pronouns.that_can(noun, can) for noun in themes[0].items}
        before = said.chosen
        said.chosen = {**before, **{at: it.subjects for at, it in its.items() if it is not None}}
        things = self.nouns.subjects(themes[0], ("object",), "an object")
        said.chosen = before
        alone = len(themes[0].items) == 1 and themes[0].items[0].words in (("it",), ("that",))
        where = None
        places = tuple(
            replace(p, role="in") if p.special in ("there", "here") and not p.preposition else p
            for p in places
        )
        self._check_all_said(frame, [p for p in places if p.role not in WHERE or p.role == "to"])
        if places:
            where = self.places.where([self.places.locative(p) for p in places], fetching=True)
        carrier = self.scene.said.carrier
        things = [
            Mention((carrier,), "object", thing.key)
            if alone
            and carrier in able
            and isinstance(thing, Mention)
            and not set(thing.subjects) & able
            else thing
            for thing in things
        ]
        source, surface = (where.source, where.source_surface) if where else (None, None)
        verb, *behind = phrase.verb.split()
        done = " ".join([participles(verb)[0], *behind])
        mentions = self.those(things, able, done, phrase.wants, source, surface)
        self.scene.said.remember(mentions)
        good_for = self.scene.vocabulary.good_for
        vessels = [
            n for m in mentions for n in m.subjects if Feature.CONTAINS in good_for.get(n, ())
        ]
        if vessels:
            self.scene.said.carrier = vessels[0] if len(vessels) == 1 else None
        for mention in mentions:
            meant = [self.scene.vocabulary.objects[n] for n in mention.subjects]
            fitting = (row for row in taken if all(map(row[0].fits, meant)))
            meant_by, besides = next(fitting, taken[0])
            self.wish([mention], (*meant_by.wants, *besides))
        return None

    def _check_all_said(self, frame: Frame, stray: Sequence[Place]) -> None:
        """Whether phrases and particles are left that mean nothing after the verb.

        Raises:
            NotUnderstood: they are.
        """
        left = [self.scene.said.quote(place.first, place.last) for place in stray]
        for text in (*left, *sorted(frame.particle_words)):
            raise NotUnderstood(f"{text!r} is not understood after {frame.verb!r}")

    def fits(self, frame: Frame, frames: Sequence[SkillFrame]) -> bool:
        """Whether the skill can be done to what is named, so that the verb means nothing else."""
        if len(frame.themes) != 1 or not self.nouns.can_be(frame.themes[0], ("object",)):
            return False
        able = {
            o.object
            for o in self.scene.vocabulary.objects.values()
            if any(f.phrase.fits(o) for f in frames if f.phrase.type not in ("place", "robot"))
        }
        subjects = self.nouns.subjects(frame.themes[0], ("object",), "an object")
        able |= set(self.nouns.parts.able(able))
        return any(set(s.names) & able for s in subjects)

    def _done_by(self, frame: Frame, phrase: SkillPhrase, who: Sequence[Subject] | None) -> None:
        """`dock`, `dock r1`: a robot does it with itself; any that can, where nobody is named."""
        themes = frame.themes
        if who is None and len(themes) == 1 and self.nouns.can_be(themes[0], ("robot",)):
            who, themes = self.nouns.subjects(themes[0], ("robot",), "a robot"), ()
        if themes or frame.places or frame.particle_words:
            raise NotUnderstood(
                f"{self.scene.said.clause!r}: a robot does that with itself; name the robot, "
                "and nothing else"
            )
        able = [
            n for n, spec in self.scene.vocabulary.robots.items() if phrase.skill in spec.skills
        ]
        if who is None:
            if not able:
                raise NotUnderstood(f"no robot that can {phrase.verb} is known")
            mentions = [Mention(tuple(sorted(able)), "robot", self.scene.said.began, len(able) > 1)]
        else:
            mentions = [self.who.resolve(s) for s in who]
        return self.wish(mentions, phrase.wants)

    def those(
        self,
        things: Sequence[Subject],
        able: Collection[str],
        done: str,
        wants: Sequence[tuple[str, Value]],
        source: str | None = None,
        surface: str | None = None,
    ) -> list[Mention]:
        """Who is meant, of those that can be `done`, by themselves or by their parts.

        Raises:
            NotUnderstood: what is named cannot be.
        """
        found = []
        whole = {*able, *self.nouns.parts.able(able)}
        for thing in things:
            left = thing
            if isinstance(thing, NounPhrase) and not thing.exact:
                open_ = thing.generic or thing.quantity in (Quantity.THE, Quantity.ANY)
                fit = (thing.among(able), thing.among(whole)) if open_ else ()
                left = next((each for each in fit if each.found), thing)
            mention = self.who.resolve(self.who.fit(left, whole, done), source, surface)
            found.append(self.nouns.parts.meant(mention, able, wants))
        return found

    def wish(self, mentions: Sequence[Mention], wants: Sequence[tuple[str, Value]]) -> None:
        """Wish that this holds of these."""
        for mention in mentions:
            for relation, value in wants:
                self.scene.said.draft.add(relation, mention, value)
