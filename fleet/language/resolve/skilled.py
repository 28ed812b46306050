"""Clauses that ask for what a skill does: "vacuum the hallway", "switch the lamp off"."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, one_of
from fleet.language.resolve.frames import Frame
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.mentions import Mention, NounPhrase, Subject
from fleet.language.resolve.places import WHERE
from fleet.language.tagging.skill_words import SkillFrame
from fleet.language.vocabulary import SkillPhrase
from keyexpr_schema.facts import (
    Value,
)
from keyexpr_schema.payloads.world import Feature


class Skilled:
    """Turns clauses that ask for a skill into wishes."""

    def __init__(self, ground: Ground) -> None:
        self.scene, self.who, self.nouns, self.places = ground

    def skill(
        self, frame: Frame, frames: Sequence[SkillFrame], who: Sequence[Subject] | None = None
    ) -> None:
        """`vacuum the hallway and the kitchen`, `switch the lamp off`.

        Raises:
            NotUnderstood: it cannot be done to what is named; of several skills of that name, the
                first says why.
        """
        tools = [p for p in frame.places if p.role == "with"]
        if tools and any(f.tool for f in frames) and tools[0].nouns is not None:
            for subject in self.nouns.subjects(tools[0].nouns, ("object",), "an object"):
                self.who.resolve(subject)
            frame = replace(frame, places=tuple(p for p in frame.places if p not in tools))
        themes = frame.themes
        if not themes and frames[0].phrase.type == "place":  # "vacuum in the kitchen"
            inside = [p for p in frame.places[:1] if p.role == "in"]
            themes = tuple(p.nouns for p in inside if p.nouns is not None)
        house = next((p for p in frame.places if p.special == "house"), None)
        places = frame.places if frame.themes else frame.places[1:]
        phrases = [f.phrase for f in frames]
        phrase = phrases[0]
        if phrase.type == "robot":
            return self._done_by(frame, phrase, who)
        if phrase.type == "place":
            if house is not None:
                names = self.places.places(house)
                mentions = [Mention((name,), "place", self.scene.said.began) for name in names]
                return self.wish(mentions, phrase.wants)
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
            return self.wish(
                [Mention((n,), "place", self.scene.said.began) for n in each], phrase.wants
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
        it = self.nouns.pronouns.that_can(themes[0].items[0], able)
        things = [it] if it else self.nouns.subjects(themes[0], ("object",), "an object")
        where = None
        places = tuple(
            replace(p, role="in") if p.special in ("there", "here") and not p.preposition else p
            for p in places
        )
        if places:
            if stray := [p for p in places if p.role not in WHERE or p.role == "to"]:
                text = self.scene.said.quote(stray[0].first, stray[0].last)
                raise NotUnderstood(f"{text!r} is not understood after {frame.verb!r}")
            where = self.places.where([self.places.locative(p) for p in places], fetching=True)
        if frame.particle_words:
            raise NotUnderstood(
                f"{sorted(frame.particle_words)[0]!r} is not understood after {frame.verb!r}"
            )
        carrier = self.scene.said.carrier
        things = [
            Mention((carrier,), "object", thing.key)
            if carrier in able
            and isinstance(thing, Mention)
            and themes[0].items[0].words in (("it",), ("that",))
            and not set(thing.subjects) & able
            else thing
            for thing in things
        ]
        source, surface = (where.source, where.source_surface) if where else (None, None)
        mentions = self.those(things, able, phrase.verb, source, surface)
        self.scene.said.remember(mentions)
        good_for = self.scene.vocabulary.good_for
        vessels = [
            n for m in mentions for n in m.subjects if Feature.CONTAINS in good_for.get(n, ())
        ]
        if vessels:
            self.scene.said.carrier = vessels[0] if len(vessels) == 1 else None
        for mention in mentions:
            meant = [self.scene.vocabulary.objects[n] for n in mention.subjects]
            fitting = next((p for p in phrases if all(map(p.fits, meant))), phrase)
            self.wish([mention], fitting.wants)
        return None

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
        return any(set(s.names) & able for s in subjects)

    def _done_by(self, frame: Frame, phrase: SkillPhrase, who: Sequence[Subject] | None) -> None:
        """`dock`: a robot does it with itself; any that can, where nobody is named."""
        if frame.themes or frame.places or frame.particle_words:
            raise NotUnderstood(f"{self.scene.said.clause!r}: that is done to nothing and nowhere")
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
        verb: str,
        source: str | None = None,
        surface: str | None = None,
    ) -> list[Mention]:
        """Who is meant, of those that it can be done to.

        Raises:
            NotUnderstood: it cannot be done to what is named.
        """
        found = []
        for thing in things:
            left = thing
            if isinstance(thing, NounPhrase) and thing.quantity.name == "THE" and not thing.exact:
                left = thing.among(able) if thing.among(able).found else thing
            fit = self.who.fit(left, able, verb)
            found.append(self.who.resolve(fit, source, surface))
        return found

    def wish(self, mentions: Sequence[Mention], wants: Sequence[tuple[str, Value]]) -> None:
        """Wish that this holds of these."""
        for mention in mentions:
            for relation, value in wants:
                self.scene.said.draft.add(relation, mention, value)
