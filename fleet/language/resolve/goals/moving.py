"""Clauses with a verb that moves things: "bring the cup to Anna", "give Ben the book"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from fleet.errors import NotUnderstood
from fleet.language.refusals import listed, one_of
from fleet.language.resolve.frames import Frame
from fleet.language.resolve.goals.wishes import HOMEWARD, Wishes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.location.places import Where
from fleet.language.resolve.location.relations import SPATIAL
from fleet.language.resolve.reference.lists import with_sources
from fleet.language.resolve.reference.mentions import NounPhrase, Subject
from fleet.language.resolve.scene import THINGS
from fleet.language.tree.nodes import Nouns, Place
from keyexpr_schema.facts import AT, HELD, IN, ON
from keyexpr_schema.payloads.world import Feature


class Moving:
    """Turns clauses with such a verb into wishes."""

    def __init__(self, ground: Ground, wishes: Wishes) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes = wishes

    def move(self, frame: Frame) -> None:
        """`bring NP to PLACE`, `give NP to ROBOT`, `give ROBOT NP`, `put NP back`.

        A verb of the sense `fetch` may leave where to go to a later clause.
        """
        give = "give" in frame.senses and "move" not in frame.senses
        fetch, tidy = "fetch" in frame.senses, "tidy" in frame.senses
        if frame.verb == "leave" and not frame.places and self._a_place(frame.themes):
            raise NotUnderstood(
                f"{self.scene.said.clause!r} says where not to be: say where to go instead"
            )
        if not frame.themes:
            for place in frame.places:
                if place.role in SPATIAL:
                    raise self.places.relations.unknown(place)
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what to {frame.verb}")
        if frame.verb.split()[0] in self.scene.tagger.book.fetching:
            frame = with_sources(frame)
        moved_nouns, receiver = frame.themes[-1], None
        to_speaker = False
        if len(frame.themes) == 2:
            if frame.themes[0].items[0].form == "me":
                to_speaker = True
            else:
                receiver = self._receiver(frame)
        moved = self.nouns.subjects(moved_nouns, THINGS, "an object")
        if len({subject.type == "robot" for subject in moved}) > 1:
            raise NotUnderstood(  # "bring Anna a cup, and cart, go to the hallway"
                f"{self.scene.said.clause!r} names robots and things side by side: say one by one"
            )
        if (aboard := self._aboard(frame)) is not None:
            with_it, spot = aboard
            rest = tuple(p for p in frame.places if p not in aboard)
            self.move(replace(frame, places=rest))
            return self.move(replace(frame, themes=(with_it.nouns or moved_nouns,), places=(spot,)))
        frame, along = self._along(frame)
        moved += [s for n in along for s in self.nouns.subjects(n, THINGS, "an object")]
        if receiver is not None:
            where, home = self.wishes.whereto(frame, fetching=True)
            if where.target is not None or home or where.each:
                raise NotUnderstood(f"{self.scene.said.clause!r} says twice where to: say one")
            target = replace(receiver, source=where.source, source_surface=where.source_surface)
            return self.wishes.to_target(moved, target, False)
        frame, beneficiary = self.wishes.for_whom(frame)
        frame, inside = self._inside(frame)
        if self.wishes.beside(moved, frame):
            return None
        fetching = frame.verb.split()[0] in self.scene.tagger.book.fetching
        fetching = fetching or self._lies_there(frame, moved)
        where, home = self.wishes.whereto(frame, each=not give, fetching=fetching)
        speaker = self.scene.vocabulary.speaker
        for_them = speaker is not None and (to_speaker or not tidy)
        brings = for_them and frame.verb.split()[0] in ("bring", "get", "fetch", "retrieve")
        whereto = where.target is not None or bool(where.each) or home
        if inside is not None and not whereto:
            where = replace(where, target=inside, target_type="object")
            where = replace(where, relation=self._relation_of(inside))
        elif beneficiary is not None and not whereto and not (tidy and not fetch):
            where = replace(where, target=beneficiary, target_type="object")
        elif to_speaker and not whereto:
            where = replace(where, target=speaker, target_type="object", for_speaker=True)
        if give and where.target is not None and not self.receives(where):
            people = sorted(filter(self.scene.vocabulary.is_person, self.scene.vocabulary.objects))
            known = listed([*self.scene.lexicon.known(("robot",)), *people])
            raise NotUnderstood(
                f"{where.target!r} is no {'robot or person' if people else 'robot'} that something "
                f"could be given to; known are {known}"
            )
        whereto = where.target is not None or bool(where.each) or home
        if frame.verb == "leave" and where.target is not None and self._there_already(moved, where):
            raise NotUnderstood(f"{self.scene.said.clause!r}: it is there already")
        if where.guessed is not None:
            self._check_from(moved, where, where.guessed)
        if (fetch or brings) and not whereto:
            return self._fetched(moved, where, frame.senses)
        return self.wishes.to_target(moved, where, home or (tidy and where.target is None))

    @staticmethod
    def _aboard(frame: Frame) -> tuple[Place, Place] | None:
        """`with a fork on it`: what shall be on or in what is moved."""
        for one, following in pairwise(frame.places):
            noun = following.nouns.items[0] if following.nouns is not None else None
            it = noun is not None and noun.form == "pronoun" and following.role == "in"
            if one.role == "with" and one.nouns is not None and it:
                return one, following
        return None

    def _along(self, frame: Frame) -> tuple[Frame, list[Nouns]]:
        """The frame without what is moved along: "the soup with a spoon", but not "with a tray",
        in which the rest may be carried."""
        along: dict[Place, Nouns] = {}
        for place in frame.places:
            nouns = place.nouns
            if nouns is None or place.role not in ("along", "with"):
                continue
            if place.role == "along" or not self._may_carry(nouns):
                along[place] = nouns
        rest = tuple(place for place in frame.places if place not in along)
        return replace(frame, places=rest), list(along.values())

    def _may_carry(self, nouns: Nouns) -> bool:
        if not self.nouns.can_be(nouns, ("object",)):
            return True
        found = self.nouns.subjects(nouns, ("object",), "an object")
        return any(self.scene.vocabulary.good_for.get(n) for s in found for n in s.names)

    def _a_place(self, themes: Sequence[Nouns]) -> bool:
        return bool(themes) and self.nouns.can_be(themes[-1], ("place",)) and not (
            self.nouns.can_be(themes[-1], THINGS)
        )  # fmt: skip

    def _inside(self, frame: Frame) -> tuple[Frame, str | None]:
        """The frame without "inside" that nothing follows, and what something was put in last."""
        inside = [p for p in frame.particles if p.lexeme.word in ("in", "inside")]
        carrier = self.scene.said.carrier
        if not inside or carrier is None or frame.places:
            return frame, None
        rest = tuple(p for p in frame.particles if p not in inside)
        return replace(frame, particles=rest), carrier

    def _relation_of(self, thing: str) -> str:
        good_for = self.scene.vocabulary.good_for.get(thing, ())
        return IN if Feature.CONTAINS in good_for else ON if Feature.SUPPORTS in good_for else AT

    def _there_already(self, moved: Sequence[Subject], where: Where) -> bool:
        """Whether "leave it there" means that it stays, as nothing has said that it is moved."""
        names = {n for s in moved for n in self.wishes.from_where(s, where).subjects}
        is_at = self.scene.vocabulary.is_at
        wished = {n for st in self.scene.said.draft.stages for w in st for n in w.subjects}
        return not names & wished and all(is_at(n, where.target or "") for n in names)

    def _check_from(self, moved: Sequence[Subject], where: Where, first: str) -> None:
        """Whether it lies where the first of two phrases says: "put the book on the sofa on the
        shelf".

        Raises:
            NotUnderstood: it lies elsewhere, so that it may be meant to be put there.
        """
        vocabulary = self.scene.vocabulary
        names = {n for s in moved for n in s.names}
        if any(vocabulary.is_at(n, first) for n in names):
            return
        if all(vocabulary.place_of(n) is None for n in names):
            return
        raise NotUnderstood(
            f"{self.scene.said.clause!r} names two places, and {first} is not believed to be "
            f"{'on' if where.relation == ON else 'in'} {where.target}, nor "
            f"{one_of(sorted(names))} to be there: say one after the other"
        )

    def _lies_there(self, frame: Frame, moved: Sequence[Subject]) -> bool:
        """`put away the things on the desk`: whether it says where they are, and not where to."""
        places = [p for p in frame.places if p.role == "in" and not p.special]
        if not places or (frame.apart and not frame.trails):
            return False
        if frame.trails and frame.verb.split()[-1] in HOMEWARD | frame.particle_words & HOMEWARD:
            return True  # "put the cup on the desk back"
        if "tidy" not in frame.senses:
            return False
        where = self.places.where([self.places.locative(p) for p in places], fetching=True)
        names = {n for s in moved for n in s.names}
        is_at = self.scene.vocabulary.is_at
        return where.source is not None and any(is_at(n, where.source) for n in names)

    def receives(self, where: Where) -> bool:
        return where.target_type == "robot" or self.scene.vocabulary.is_person(where.target or "")

    def _receiver(self, frame: Frame) -> Where:
        if frame.verb.split()[0] not in self.scene.tagger.book.offering:
            raise NotUnderstood(f"{self.scene.said.clause!r} names two things side by side")
        if frame.themes[0].items[1:]:  # "give Ben and Lily a glass"
            persons = self.nouns.subjects(frame.themes[0], ("object",), "a person")
            names = tuple(self.who.all_of(persons))
            if not all(map(self.scene.vocabulary.is_person, names)):
                raise NotUnderstood(f"{self.scene.said.clause!r} names two things side by side")
            return Where(None, each=names, text=self.scene.said.clause)
        subject = self.nouns.subject(frame.themes[0].items[0], THINGS, "a robot")
        mention = self.who.resolve(subject)
        name = mention.subjects[0]
        self.scene.said.spoken_of(mention.subjects)
        people = all(map(self.scene.vocabulary.is_person, mention.subjects))
        if mention.each and people and isinstance(subject, NounPhrase):  # "bring each patient a …"
            return Where(None, each=mention.subjects, text=subject.text)
        if mention.open or len(mention.subjects) != 1:
            text = subject.text if isinstance(subject, NounPhrase) else self.scene.said.clause
            raise NotUnderstood(f"{text!r} does not say which {mention.type}: name it")
        if mention.type != "robot" and not self.scene.vocabulary.is_person(name):
            raise NotUnderstood(f"{name} is no robot or person that something could be given to")
        return Where(None, name, mention.type)

    def _fetched(self, moved: Sequence[Subject], where: Where, senses: frozenset[str]) -> None:
        if any(subject.type == "robot" for subject in moved):
            raise self.wishes.no_target()
        mentions = [self.wishes.from_where(self.who.movable(s), where) for s in moved]
        later = "hold" not in senses or self.scene.vocabulary.speaker is None
        for mention in mentions:
            self.scene.said.draft.add(HELD, mention, True, whereto=later)
        self.scene.said.remember(mentions)
