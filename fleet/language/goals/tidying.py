"""Clauses about order: tidying up a room or everything, clearing a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fleet.errors import NotUnderstood
from fleet.language.goals.moving import HOME_HINT
from fleet.language.goals.states import States
from fleet.language.phrases.mentions import Mention
from fleet.language.refusals import one_of
from fleet.language.words.wordlists import WHOLE_HOUSE
from keyexpr_schema.payloads.world import Feature


class Tidying(States):
    """Turns clauses about order into wishes that things are where they belong."""

    def tidy(self) -> None:
        """`tidy up`, `tidy up the kitchen`, `tidy up the coffee table`, `put the cups away`."""
        cursor = self.cursor
        cursor.take("up")
        preposed = cursor.preposition() is not None
        about_things = cursor.word() in ("it", "them") or (
            not cursor.next_of(WHOLE_HOUSE)
            and self.nouns.starts(("object",))
            and not self._furniture_next()
        )
        if not preposed and about_things:
            return self.move(tidy=True)
        homes = {
            o.object: o.home
            for o in self.vocabulary.objects.values()
            if o.is_a(Feature.MOVABLE) and o.home and self.is_spot(o.home)
        }
        names = tuple(homes)
        if preposed or not (cursor.at_border() or cursor.word() == "and"):
            names = self._within(homes)
            cursor.take("up")
        cursor.take_word(("up", "away"))
        if not names:
            raise NotUnderstood(f"nothing has a home: {HOME_HINT}")
        return self._to_their_homes(names, homes)

    def _furniture_next(self) -> bool:
        """Whether what comes next is a thing that stays where it is, and has others on it."""
        start = self.cursor.at
        noun = self.nouns.noun("an object", ("object",))
        self.cursor.at = start
        things = self.vocabulary.objects
        return all(
            name in self.vocabulary.good_for and not things[name].is_a(Feature.MOVABLE)
            for name in noun.names
        )

    def clear(self) -> None:
        """`clear TABLE`, after the verb: what lies on it goes where it belongs."""
        things = self.vocabulary.objects.values()
        homes = {o.object: o.home for o in things if o.is_a(Feature.MOVABLE) and o.home}
        mentions = self.place_mentions() or []
        if not mentions or any(mention.type != "surface" for mention in mentions):
            places = [name for m in mentions for name in m.subjects] or list(self.vocabulary.places)
            raise NotUnderstood(
                f"{self.clause!r}: name the things and where to bring them, or say "
                f'"tidy up {one_of(places)}"'
            )
        self._to_their_homes([n for m in mentions for n in self._lying_on(m, homes)], homes)

    def _to_their_homes(self, names: Sequence[str], homes: Mapping[str, str]) -> None:
        start = self.began
        for name in names:
            self.to_spot(Mention((name,), "object", start), homes[name])
        self.subjects.remember([Mention(tuple(names), "object", start)])

    def _within(self, homes: Mapping[str, str]) -> tuple[str, ...]:
        """What is to be tidied up in the places that come next, or in all of them."""
        mentions = self.place_mentions()
        if mentions is None:
            return tuple(homes)
        places = dict.fromkeys(n for m in mentions if m.type == "place" for n in m.subjects)
        if len(places) > 1 and set(places) == set(self.vocabulary.places):
            return tuple(homes)
        on_tables = [n for m in mentions if m.type == "surface" for n in self._lying_on(m, homes)]
        in_rooms = self._misplaced(homes, tuple(places)) if places else ()
        return tuple(dict.fromkeys((*in_rooms, *on_tables)))

    def _misplaced(self, homes: Mapping[str, str], where: Sequence[str]) -> tuple[str, ...]:
        """What is believed to be in these places and belongs elsewhere.

        Raises:
            NotUnderstood: there is nothing of that kind in one of them.
        """
        at = self.vocabulary.is_at
        names = tuple(
            n for n, home in homes.items() if any(at(n, p) for p in where) and not at(n, home)
        )
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
        surface, vocabulary = one_of(table.surfaces), self.vocabulary
        place = self.place_of(table.subjects[0])
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
