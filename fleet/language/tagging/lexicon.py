"""What words can stand for: exact names, kinds, and words that occur in names."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from fleet.language.vocabulary import Vocabulary
from fleet.language.words.morphology import plurals
from fleet.language.words.tokens import Phrase, Token, number_of, ordinal_of, words_of
from keyexpr_schema.payloads.world import Feature

EntityType = Literal["object", "place", "robot", "surface"]
ENTITY_TYPES: tuple[EntityType, ...] = ("object", "place", "robot", "surface")
CATEGORIES: dict[EntityType, tuple[str, ...]] = {
    "object": ("object", "thing", "item"),
    "robot": ("robot",),
    "place": ("room", "place", "area", "location"),
    "surface": ("surface",),
}


@dataclass(frozen=True, eq=False)
class Entity:
    """Something that has a name. A surface stands for the place that it belongs to, where it is no
    thing of its own. A thing that others can be on or in, and a person, is a surface as well as an
    object, and stands for itself."""

    id: str
    type: EntityType
    stands_for: str
    names: frozenset[Phrase]
    kinds: frozenset[Phrase]
    ordinal: int | None = None
    kin: frozenset[Phrase] = frozenset()
    """The kinds that tell who else "the other one" may be; `kinds` has wider ones, too."""
    uses: frozenset[str] = frozenset()
    person: bool = False
    said: frozenset[Phrase] = frozenset()
    """Words that are true of it without being its name: its colour."""

    @property
    def rank(self) -> tuple[int, str]:
        """By ordinal, then by id."""
        return (self.ordinal or 0, self.id)

    def is_headed(self, words: Phrase) -> bool:
        """Whether words that occur in its names say what it is: of a car key "key", not "car"."""
        last, behind = words[-1], _BEHIND & set(words)
        heads = {_head(name) for name in self.names} | {kind[-1] for kind in self.kinds}
        heads |= {name[-1] for name in self.names if "of" in name}  # "the chips", of a bag of chips
        plural = {ending for head in heads for ending in plurals(head)}
        told = any(last in said for said in self.said) or bool(behind)
        return told or last in heads | plural or words in self.names or number_of(last) is not None


_BEHIND = frozenset({"of", "in", "on", "at", "for", "with", "from"})
"""What stands behind one of these in a name tells the thing apart and is not what it is."""
_COUNTED = 50
"""Numbers above are those of rooms, and count nothing."""


class Lexicon:
    """Looks words up among the names of a vocabulary."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        language = vocabulary.wordbook
        self._grammar, self._rooms = language.grammar, language.rooms
        self.entities = tuple(_entities(vocabulary))
        self._meant: dict[Phrase, tuple[Entity, ...]] = {}
        self._exact: dict[Phrase, list[Entity]] = defaultdict(list)
        self._numbered: dict[Phrase, set[str]] = defaultdict(set)
        self._kinds: dict[Phrase, tuple[bool, list[Entity]]] = {}
        self._by_word: dict[str, set[Entity]] = defaultdict(set)
        self._by_kin: dict[tuple[EntityType, Phrase], list[Entity]] = defaultdict(list)
        for entity in self.entities:
            for name in entity.names:
                self._exact[name].append(entity)
                if number_of(name[-1]) is not None:
                    self._numbered[name[:-1]].add(entity.stands_for)
            for kind in entity.kin:
                self._by_kin[entity.type, kind].append(entity)
            for kind in entity.kinds:
                self._kinds.setdefault(kind, (False, []))[1].append(entity)
                for word in kind:
                    self._by_word[word].add(entity)
            for name in (*entity.names, *entity.said):
                for word in name:
                    self._by_word[word].add(entity)
        for kind, (_, members) in list(self._kinds.items()):
            for ending in plurals(kind[-1]):
                plural = (*kind[:-1], ending)
                if plural not in self._kinds:
                    self._kinds[plural] = (True, list(members))
                elif self._kinds[plural][0]:
                    self._kinds[plural][1].extend(members)
                self._by_word[ending].update(members)
        self._add_synonyms()
        self._add_numbers()
        self._longest = max(map(len, self._exact), default=0)

    def known(self, types: Iterable[EntityType]) -> list[str]:
        """The ids of those types, as a person should see them."""
        return [
            name
            for entity_type in types
            if entity_type != "surface"
            for name in sorted(e.id for e in self.entities if e.type == entity_type)
        ]

    def names_in(self, types: Sequence[EntityType]) -> set[str]:
        """Words of all names and kinds of those types, for those who mistyped one."""
        return {
            " ".join(words)
            for e in self.entities
            if e.type in types
            for words in (*e.names, *e.kinds)
        } | {
            word
            for e in self.entities
            if e.type in types
            for name in e.names
            for word in name
            if len(word) > 3
        }

    def exact(
        self, tokens: Sequence[Token], at: int, types: Sequence[EntityType]
    ) -> tuple[int, tuple[Entity, ...]]:
        """The longest name that starts at a token: where it ends, and who has it."""
        for length in range(min(self._longest, len(tokens) - at), 0, -1):
            name = tuple(token.word for token in tokens[at : at + length])
            found = [e for e in self._exact.get(name, ()) if e.type in types]
            if found:
                return at + length, tuple(sorted(set(found), key=lambda e: e.rank))
        return at, ()

    def begins_numbered(self, tokens: Sequence[Token], at: int) -> int:
        """Where the longest run from a token ends that several names begin with, which go on with
        a number only."""
        for length in range(min(self._longest - 1, len(tokens) - at), 1, -1):
            if len(self._numbered.get(tuple(t.word for t in tokens[at : at + length]), ())) > 1:
                return at + length
        return at

    def described(
        self, tokens: Sequence[Token], at: int, types: Sequence[EntityType]
    ) -> tuple[int, tuple[Entity, ...]]:
        """The longest run of words that all occur in names or kinds of the same entities."""
        end, found = at, set[Entity]()
        while end < len(tokens) and (word := tokens[end].word) not in self._grammar:
            named = self._by_word.get(word, set())
            narrower = found & named if end > at else {e for e in named if e.type in types}
            if not narrower or number_of(word) is not None:
                break
            end, found = end + 1, narrower
        return (end, tuple(sorted(found, key=lambda e: e.rank))) if end > at else (at, ())

    def meant(self, words: Phrase) -> tuple[Entity, ...]:
        """Everybody whom these words can mean, by name or by the words in names and kinds."""
        if (known := self._meant.get(words)) is None:
            tokens = [Token(word, word, 0, 0) for word in words]
            end, named = self.exact(tokens, 0, ENTITY_TYPES)
            known = named if end == len(words) else ()
            end, found = self.described(tokens, 0, ENTITY_TYPES)
            known = (*known, *(e for e in found if end == len(words) and e not in known))
            self._meant[words] = known
        return known

    def kind(
        self, tokens: Sequence[Token], at: int, end: int, types: Sequence[EntityType]
    ) -> tuple[bool, frozenset[Entity]] | None:
        """Whether a run of words ends in a kind: whether that is plural, and who is of it.

        The longest kind counts: of "coffee cup" rather `coffee cup` than `cup`.
        """
        for start in range(at, end):
            entry = self._kinds.get(tuple(token.word for token in tokens[start:end]))
            if entry is not None and (of := frozenset(e for e in entry[1] if e.type in types)):
                return entry[0], of
        return None

    def is_several(self, name: Phrase, types: Sequence[EntityType]) -> bool:
        """Whether the words are a kind with more than one member."""
        _, members = self._kinds.get(name, (False, []))
        return len({e for e in members if e.type in types}) > 1

    def is_kin(self, words: Phrase, entity: Entity) -> bool:
        """Whether the words are the very kind of it, or its plural."""
        forms = {(*kind[:-1], ending) for kind in entity.kin for ending in plurals(kind[-1])}
        return words in entity.kin or words in forms

    def kin(self, entity: Entity) -> tuple[Entity, ...]:
        """All of the same kind; the entity too."""
        kin = {e for kind in entity.kin for e in self._by_kin[entity.type, kind]}
        return tuple(sorted({entity, *kin}, key=lambda e: e.rank))

    def _add_numbers(self) -> None:
        """`102` for "room 102", where nothing else has so high a number."""
        of_number: dict[int, list[Entity]] = defaultdict(list)
        for entity in self.entities:
            if entity.type == "place" and entity.ordinal is not None and entity.ordinal > _COUNTED:
                of_number[entity.ordinal].append(entity)
        for number, found in of_number.items():
            if len(found) == 1 and (str(number),) not in self._exact:
                self._exact[str(number),] = found

    def _add_synonyms(self) -> None:
        """Common words for rooms, where just one place can be meant and nothing is called so."""
        for names in self._rooms:
            meant = {
                e
                for e in self.entities
                if e.type == "place" and any(name in e.names for name in names)
            }
            if len(meant) == 1:
                for name in names:
                    if name not in self._exact:
                        self._exact[name] = list(meant)


def _entities(vocabulary: Vocabulary) -> Iterator[Entity]:
    for thing in vocabulary.objects.values():
        names = _names(thing.object, thing.label, *thing.aliases)
        kin = _names(thing.kind)
        ordinal = _rank_within(names) or thing.ordinal
        yield Entity(
            thing.object,
            "object",
            thing.object,
            names,
            _kinds("object", thing.kind, *thing.categories, *_nouns(thing.features)),
            ordinal,
            kin,
            frozenset(thing.uses),
            vocabulary.is_person(thing.object),
            _names(
                *(
                    value
                    for key, value in thing.properties.items()
                    if isinstance(value, str) and value not in vocabulary.objects
                )
            ),
        )
        if thing.object in vocabulary.good_for:
            kinds = _names(thing.kind, *thing.categories)
            yield Entity(thing.object, "surface", thing.object, names, kinds, ordinal, kin)
    for spec in vocabulary.robots.values():
        yield Entity(
            spec.robot,
            "robot",
            spec.robot,
            _names(spec.robot, spec.label),
            _kinds("robot", spec.model, *_unnumbered(spec.robot, spec.label)),
            _number(spec.robot, spec.label),
            _names(spec.model, *_unnumbered(spec.robot, spec.label)),
        )
    for place in vocabulary.places.values():
        yield Entity(
            place.place,
            "place",
            place.place,
            _names(place.place, place.label, *place.aliases),
            _kinds("place", *_unnumbered(place.place, place.label)),
            _number(place.place, place.label),
        )
        for surface in place.surfaces:
            if surface.surface in vocabulary.objects:
                continue
            yield Entity(
                surface.surface, "surface", place.place, _names(surface.surface), frozenset()
            )


def _head(name: Phrase) -> str:
    """What a name says that the thing is: `bag` of "bag of chips", `shelf` of "shelf A"."""
    end = next((i for i, word in enumerate(name) if i and word in _BEHIND), len(name))
    while end > 1 and (len(name[end - 1]) == 1 or number_of(name[end - 1]) is not None):
        end -= 1
    return name[end - 1]


def _nouns(features: Iterable[str]) -> Iterator[str]:
    """Features that a skill file names by a noun: `instrument`, but not `washable`."""
    own = {feature.value for feature in Feature}
    return (f for f in features if f not in own and not f.endswith("able"))


def _rank_within(names: Iterable[Phrase]) -> int | None:
    """The rank of a part among those of its whole: 2 for "second drawer of the dresser"."""
    ranks = (ordinal_of(name[0]) for name in names if "of" in name)
    return next((rank for rank in ranks if rank is not None), None)


def _unnumbered(*names: str) -> tuple[str, ...]:
    """What numbered names are called without their numbers: `carrier` of `carrier_2`."""
    found = [words[:-1] for words in map(words_of, names) if len(words) > 1]
    numbered = [words_of(name)[-1].isdecimal() for name in names if len(words_of(name)) > 1]
    return tuple(
        dict.fromkeys(
            " ".join(w) for w, is_number in zip(found, numbered, strict=True) if is_number
        )
    )


def _number(*names: str) -> int | None:
    """The number at the end of a name."""
    ends = [words_of(name)[-1] for name in names if len(words_of(name)) > 1]
    return next((int(end) for end in ends if end.isdecimal() and len(end) < 7), None)


def _names(*names: str) -> frozenset[Phrase]:
    return frozenset(words for name in names if (words := words_of(name)))


def _kinds(entity_type: EntityType, *kinds: str) -> frozenset[Phrase]:
    return frozenset({(word,) for word in CATEGORIES[entity_type]} | _names(*kinds))
