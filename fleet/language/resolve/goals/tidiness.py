"""Clauses about order: tidying up a room or everything, clearing a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.frames import HOME_HINT, Frame
from fleet.language.resolve.goals.moving import Moving
from fleet.language.resolve.goals.wishes import Wishes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.reference.mentions import Mention, NounPhrase
from fleet.language.resolve.scene import THINGS
from fleet.language.tree.nodes import (
    Noun,
    Nouns,
)
from keyexpr_schema.facts import IN
from keyexpr_schema.payloads.world import Feature

_ORDER = frozenset({"tidy", "clean", "clear"})
"""Of all that there is, where it is not said of what; "put away" wants to know what."""


class Tidiness:
    """Turns clauses about order into wishes that things are where they belong."""

    def __init__(self, ground: Ground, wishes: Wishes, moving: Moving) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes, self.moving = wishes, moving

    def tidy(self, frame: Frame) -> None:
        """`tidy up`, `tidy up the kitchen`, `tidy up the coffee table`, `put the cups away`."""
        homes = {
            o.object: o.home
            for o in self.scene.vocabulary.objects.values()
            if o.is_a(Feature.MOVABLE) and o.home and self.wishes.homes.is_spot(o.home)
        }
        names: tuple[str, ...] = ()
        house = any(p.special == "house" for p in frame.places)
        if "move" in frame.senses and not (frame.themes or frame.places):
            raise NotUnderstood(
                f"{self.scene.said.clause!r} does not say what to {frame.verb}; a robot has no "
                "home: name the place where it shall go"
            )
        if not (frame.themes or frame.places) and frame.verb.split()[0] not in _ORDER:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what to {frame.verb}")
        self._check_one(frame)
        theme = frame.themes[0] if frame.themes else None
        whole = theme is not None and len(theme.items) == 1 and _everything(theme.items[0])
        if theme is not None and not (whole and not frame.places):
            if whole or (self._about_things(theme) and not self._furniture(theme)):
                return self.moving.move(replace(frame, senses=frame.senses | {"tidy", "move"}))
            names = self._within(self.places.place_mentions(theme), homes)
            if frame.places:
                raise NotUnderstood(f"{self.scene.said.clause!r} names places twice: name one")
        elif frame.places and not house:
            mentions = []
            for place in frame.places:
                if place.role != "in" or place.nouns is None:
                    raise NotUnderstood(f"{self.scene.said.clause!r}: say what or where to tidy up")
                mentions.extend(self.places.place_mentions(place.nouns))
            names = self._within(mentions, homes)
        else:
            names = tuple(self.wishes.homes.in_nobodys_hand(tuple(homes)))
        if not names:
            raise NotUnderstood(f"nothing has a home: {HOME_HINT}")
        return self._to_their_homes(names, homes)

    def throw_away(self, frame: Frame) -> None:
        """`throw away the newspaper`: into the one bin there is."""
        if len(frame.themes) != 1:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what to throw away")
        bins = {
            e.id
            for words in self.scene.tagger.book.bins
            for e in self.scene.lexicon.meant(words)
            if Feature.CONTAINS in self.scene.vocabulary.good_for.get(e.id, ())
        }
        if not bins:
            raise NotUnderstood(f"{self.scene.said.clause!r}: no bin is known to throw it into")
        where, _ = self.wishes.whereto(frame, fetching=True)
        if where.target is None and len(bins) != 1:
            raise NotUnderstood(f"it could be {one_of(sorted(bins))}: say which bin")
        target = where.target or min(bins)
        moved = self.nouns.subjects(frame.themes[0], THINGS, "an object")
        where = replace(where, target=target, target_type="object", relation=IN)
        return self.wishes.to_target(moved, where, False)

    def _about_things(self, theme: Nouns) -> bool:
        return self.nouns.can_be(theme, ("object",))

    def _furniture(self, theme: Nouns) -> bool:
        """Whether it is things that stay where they are, and have others on them."""
        if any(noun.form == "pronoun" for noun in theme.items):
            return False
        things = self.scene.vocabulary.objects
        subjects = self.nouns.subjects(theme, ("object",), "an object")
        names = [n for s in subjects for n in (s.names if isinstance(s, NounPhrase) else ())]
        return all(
            n in self.scene.vocabulary.good_for and not things[n].is_a(Feature.MOVABLE)
            for n in names
        )

    def clear(self, frame: Frame) -> None:
        """`clear TABLE`, after the verb: what lies on it goes where it belongs."""
        things = self.scene.vocabulary.objects.values()
        homes = {o.object: o.home for o in things if o.is_a(Feature.MOVABLE) and o.home}
        self._check_one(frame)
        nouns = frame.themes[0] if frame.themes else None
        nouns = nouns or next((p.nouns for p in frame.places if p.nouns is not None), None)
        mentions = self.places.place_mentions(nouns) if nouns is not None else []
        if not mentions or any(mention.type != "surface" for mention in mentions):
            places = [name for m in mentions for name in m.subjects] or list(
                self.scene.vocabulary.places
            )
            raise NotUnderstood(
                f"{self.scene.said.clause!r}: name the things and where to bring them, or say "
                f'"tidy up {one_of(places)}"'
            )
        self._to_their_homes([n for m in mentions for n in self._lying_on(m, homes)], homes)

    def _check_one(self, frame: Frame) -> None:
        """Whether the verb has one object at most: "tidy it everyday" has two, side by side."""
        if len(frame.themes) > 1:
            more = frame.themes[1].items
            text = self.scene.said.quote(more[0].first, more[-1].last)
            raise NotUnderstood(f"{text!r} is not understood after {frame.verb!r}")

    def _to_their_homes(self, names: Sequence[str], homes: Mapping[str, str]) -> None:
        start = self.scene.said.began
        for name in names:
            self.wishes.homes.to_spot(Mention((name,), "object", start), homes[name])
        self.scene.said.remember([Mention(tuple(names), "object", start)])

    def _within(self, mentions: Sequence[Mention], homes: Mapping[str, str]) -> tuple[str, ...]:
        """What is to be tidied up in these places."""
        places = dict.fromkeys(n for m in mentions if m.type == "place" for n in m.subjects)
        if len(places) == 1:
            self.scene.said.last_place = next(iter(places))
        if len(places) > 1 and set(places) == set(self.scene.vocabulary.places):
            return tuple(self.wishes.homes.in_nobodys_hand(tuple(homes)))
        on_tables = [n for m in mentions if m.type == "surface" for n in self._lying_on(m, homes)]
        in_rooms = self._misplaced(homes, tuple(places)) if places else ()
        return tuple(dict.fromkeys((*in_rooms, *on_tables)))

    def _misplaced(self, homes: Mapping[str, str], where: Sequence[str]) -> tuple[str, ...]:
        """What is believed to be in these places and belongs elsewhere.

        Raises:
            NotUnderstood: there is nothing of that kind in one of them.
        """
        at = self.scene.vocabulary.is_at
        there = [n for n, home in homes.items() if any(at(n, p) for p in where) and not at(n, home)]
        names = tuple(self.wishes.homes.in_nobodys_hand(there))
        if tidy := [place for place in where if not any(at(name, place) for name in names)]:
            raise NotUnderstood(
                f"nothing that belongs elsewhere is believed to be in {one_of(tidy)}: have it "
                'searched first, or say where things belong with the field "home" of the object'
            )
        return names

    def _lying_on(self, table: Mention, homes: Mapping[str, str]) -> list[str]:
        """What is believed to lie on a surface, all of which must have its home elsewhere.

        Raises:
            NotUnderstood: there is nothing, or not all of it is known, or some cannot go anywhere.
        """
        surface, vocabulary = one_of(table.surfaces), self.scene.vocabulary
        place = self.places.place_of(table.subjects[0])
        there = [n for n, where in vocabulary.whereabouts.items() if where == place]
        things = vocabulary.objects
        there = [n for n in there if n in things and things[n].is_a(Feature.MOVABLE)]
        searched = f"have {place} searched first"
        if unsure := [name for name in there if name not in vocabulary.rests]:
            raise NotUnderstood(
                f"it is not known whether {one_of(unsure)} lies on {surface}: {searched}, or name "
                "the things and where to bring them"
            )
        on = table.surfaces
        names = [n for n in there if any(vocabulary.is_at(n, s) for s in on)]
        if not names:
            raise NotUnderstood(f"nothing is believed to lie on {surface}: {searched}")
        if stuck := [n for n in names if homes.get(n, place) in (place, *on)]:
            raise NotUnderstood(
                f"of what lies on {surface}, {' and '.join(stuck)} has no home in another place: "
                "say where to bring it"
            )
        return names


def _everything(noun: Noun) -> bool:
    """Whether it is everything, of no kind and nowhere in particular."""
    narrowed = noun.relatives or noun.places or noun.but or noun.adjectives or noun.use
    return noun.form == "general" and not narrowed
