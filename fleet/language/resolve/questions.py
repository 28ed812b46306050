"""Questions, as data for those who answer them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace as replaced

from msgspec.structs import replace

from fleet.errors import NotUnderstood
from fleet.language.resolve.frames import framed
from fleet.language.resolve.goals.wishes import Wishes
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.reference.mentions import Mention, NounPhrase, Subject
from fleet.language.resolve.reference.states import of_each
from fleet.language.resolve.scene import PLACES, THINGS, Question
from fleet.language.tagging.tagger import Lexeme
from fleet.language.tree.nodes import Argument, Clause, Noun, Nouns, Place, Predicate, Quantity
from fleet.language.words.morphology import participles
from keyexpr_schema.facts import AT, SEARCHED
from keyexpr_schema.payloads.goals import Condition

Holds = tuple[Condition, ...]
_GUESSES = frozenset({"can", "could", "may", "would", "will", "should", "shall"})


class Questions:
    """Turns questions into data."""

    def __init__(self, ground: Ground, wishes: Wishes) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes = wishes

    def check_mode(self) -> None:
        """Whether questions are understood here."""
        if self.scene.mode:
            raise NotUnderstood(
                f"{self.scene.said.line!r} is a question; a {self.scene.mode} says what "
                f"{'should hold' if self.scene.mode == 'goal' else 'holds'}"
            )

    def asks(self, question: Question) -> None:
        """Keep what is asked.

        Raises:
            NotUnderstood: only a goal or a fact is understood here, or two things are asked.
        """
        self.check_mode()
        if self.scene.question is not None:
            raise NotUnderstood(f"{self.scene.said.line!r} asks two things: ask one at a time")
        self.scene.question = question

    # --- of whom ----------------------------------------------------------------------------------
    def _names(self, subject: Subject) -> tuple[str, ...]:
        """Everybody who can be meant; those who are where the words say, where they say it."""
        if isinstance(subject, Mention):
            return subject.subjects
        names = subject.names if subject.ordinal is None else subject.resolve().subjects
        if subject.source is None:
            return names
        is_at = self.scene.vocabulary.is_at
        there = tuple(n for n in names if is_at(n, subject.source or ""))
        if not there:
            raise NotUnderstood(f"{subject.text!r}: nothing of that kind is believed to be there")
        return there

    def _asked_of(self, nouns: Nouns) -> tuple[tuple[str, ...], Holds]:
        """Those that a question is about, and what their own words say of each of them, `?`.

        Nobody: it is asked of anything.
        """
        types = THINGS if self.nouns.can_be(_kinds_of(nouns), THINGS) else PLACES
        names: dict[str, None] = {}
        said: list[Holds] = []
        for noun, plain in zip(nouns.items, _kinds_of(nouns).items, strict=True):
            one = self.nouns.noun(plain, types, "an object, robot or place") if (
                plain.form not in ("pronoun", "me")
            ) else self.nouns.subject(plain, types, "an object, robot or place")  # fmt: skip
            found = self._names(one)
            everything = isinstance(one, NounPhrase) and one.generic and one.type == "object"
            names |= dict.fromkeys(() if everything else found)
            said.append(self._own_words(noun, found))
        if len(set(said)) > 1:
            text = self.scene.said.quote(nouns.items[0].first, nouns.items[-1].last)
            raise NotUnderstood(f"{text!r} are of several kinds: ask of one at a time")
        return tuple(names), said[0]

    def _own_words(self, noun: Noun, names: Sequence[str]) -> Holds:
        """What a noun phrase says of those that it means: "clean plates", "plates on the table"."""
        holds: list[Condition] = []
        for word in noun.adjectives:
            if "SUP" not in word.tags and word.words in self.scene.stated.states:
                holds += self._stated([word], names)
        for relative in noun.relatives:
            if relative.state is not None:
                holds += self._stated([relative.state], names, relative.negated)
            elif relative.negated:
                raise self._not_where()
            holds += self._placed(relative.places)
        holds += self._placed(noun.places)
        return tuple(holds)

    def _not_where(self) -> NotUnderstood:
        return NotUnderstood(f"{self.scene.said.clause!r}: ask where they are, not where not")

    # --- what may be so of them -------------------------------------------------------------------
    def _stated(
        self, words: Sequence[Lexeme], names: Sequence[str], negated: bool = False
    ) -> list[Condition]:
        able = [n for n in names if any(n in self.scene.stated.able(word) for word in words)]
        rows = of_each(self.scene.stated, words, able[:1] or names[:1], negated)
        return [Condition(relation=r, subject="?", value=v) for r, _, v in dict.fromkeys(rows)]

    def _placed(self, arguments: Sequence[Argument]) -> list[Condition]:
        if not arguments:
            return []
        if not all(isinstance(argument, Place) for argument in arguments):
            raise NotUnderstood(f"{self.scene.said.clause!r} is a question that is not understood")
        where, home = self.wishes.whereto(framed(arguments))
        target = where.target or where.source
        if target is None or home:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say where")
        return [Condition(relation=where.relation, subject="?", value=target)]

    def _asked(self, clause: Clause, names: Sequence[str], negated: bool = False) -> Holds:
        """What may be so of each of them, who are then called `?`."""
        predicate = clause.predicate
        arguments = predicate.arguments if predicate is not None else clause.arguments
        words = predicate.words if predicate is not None else ()
        if predicate is not None and predicate.kind == "done":
            if predicate.arguments:
                raise NotUnderstood(
                    f"{self.scene.said.clause!r} is a question that is not understood"
                )
            if words[0].words not in self.scene.stated.states:
                if words[0].word in self.scene.tagger.book.searched:
                    return (Condition(relation=SEARCHED, subject="?", value=not negated),)
                raise NotUnderstood(
                    f"{self.scene.said.clause!r} is a question that is not understood"
                )
        if words:
            return tuple(self._stated(words, names, negated))
        if negated and arguments:
            raise self._not_where()
        return tuple(self._placed(arguments))

    # --- the kinds of questions -------------------------------------------------------------------
    def ask_where(self, clause: Clause) -> None:
        """`where is the cup?`"""
        if clause.subject is None:
            return self.asks(Question("where", (self._speaker(),)))
        found = self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
        names = dict.fromkeys(name for subject in found for name in self._names(subject))
        return self.asks(Question("where", tuple(names)))

    def _speaker(self) -> str:
        speaker = self.scene.vocabulary.speaker
        if speaker is None:
            raise NotUnderstood(f"{self.scene.said.clause!r}: who asks is not known: say who it is")
        return speaker

    def on_asked(self, clause: Clause) -> None:
        """`which windows are open?`, `how many of the plates are in the kitchen?`"""
        return self._of_those(clause, negated=clause.has("NOT"))

    def on_asked_undone(self, clause: Clause) -> None:
        """`which beds still have to be made?`, `how many parcels need scanning?`"""
        if any(word.word in _GUESSES for word in clause.words):
            raise NotUnderstood(f"{self.scene.said.clause!r} is a question that is not understood")
        gerund = next((w for w in clause.words if "GER" in w.tags), None)
        if gerund is not None:
            heads = self.scene.tagger.verbs.heads(gerund.words, "GER")
            done = replaced(gerund, words=(participles(heads[0][0])[0], *heads[0][1:]))
            clause = replaced(clause, predicate=Predicate("done", (done,)))
        return self._of_those(clause, negated=True)

    def _of_those(self, clause: Clause, negated: bool) -> None:
        of = "how many" if clause.has("HOWMANY") else "which"
        if clause.subject is None:  # "what is in the fridge?"
            return self.asks(Question(of, (), self._asked(clause, (), negated)))
        names, own = self._asked_of(clause.subject)
        asked = tuple(dict.fromkeys((*self._asked(clause, names, negated), *own)))
        if of == "which" and not asked:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what they should be")
        return self.asks(Question(of, names, asked))

    def on_contained(self, clause: Clause) -> None:
        """`what does the fridge contain?`, `what has Ben got?`"""
        assert clause.subject is not None
        types = THINGS if self.nouns.can_be(clause.subject, THINGS) else PLACES
        found = self.nouns.subjects(clause.subject, types, "an object, robot or place")
        names = self.who.all_of(found)
        if len(names) != 1:
            raise NotUnderstood(f"{self.scene.said.clause!r}: ask of one at a time")
        relation = self.scene.vocabulary.relation_to(names[0])
        self.asks(
            Question("which", (), (Condition(relation=relation, subject="?", value=names[0]),))
        )

    def on_whether(self, clause: Clause) -> None:
        """`is the door open?`, `are there any clean glasses?`"""
        assert clause.subject is not None
        open_ = [n for n in clause.subject.items if n.quantity in (Quantity.ANY, Quantity.BARE)]
        exists = clause.has("THERE") or any(
            (n.quantity is Quantity.ANY and n.form == "noun")
            or any("SOMETHING" in word.tags for word in n.head)
            for n in open_
        )  # fmt: skip
        if exists:
            return self.on_whether_any(clause)
        types = THINGS if self.nouns.can_be(clause.subject, THINGS) else PLACES
        mentions = [
            self.who.resolve(s)
            for s in self.nouns.subjects(clause.subject, types, "an object or a robot")
        ]
        negated = clause.has("NOT") and not clause.has("ISARE")
        if (rows := self._of_parts(clause, mentions, negated)) is not None:
            return self.asks(Question("whether", (), rows))
        names = [name for mention in mentions for name in mention.subjects]
        held = self._asked(clause, names, negated)
        if any(mention.open for mention in mentions):
            return self.asks(Question("whether", tuple(names), held))
        rows = tuple(replace(each, subject=name) for name in names for each in held)
        if not rows:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say what may be so")
        return self.asks(Question("whether", (), rows))

    def _of_parts(self, clause: Clause, mentions: Sequence[Mention], negated: bool) -> Holds | None:
        """`is the cabinet open?`: whether any of its drawers is; closed: whether all are."""
        words = clause.predicate.words if clause.predicate is not None else ()
        stated = self.scene.stated
        if len(mentions) != 1 or len(mentions[0].subjects) != 1 or len(words) != 1:
            return None
        able = stated.able(words[0])
        parts = self.nouns.parts.able(able).get(mentions[0].subjects[0])
        if parts is None:
            return None
        wants = stated.wants(words[0], parts[0], negated)
        every = all(value is False for _, value in wants)
        each = [(part, ()) for part in parts] if every else [(parts[0], parts)]
        return tuple(
            Condition(relation=relation, subject=part, value=value, any_of=any_of)
            for part, any_of in each
            for relation, value in wants
        )

    def on_whether_or(self, clause: Clause) -> None:
        """`is the door locked or unlocked?`"""
        assert clause.subject is not None
        words = [word for word in clause.words if "ADJ" in word.tags]
        found = self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
        names = self.who.all_of(found)
        first, other = (self.scene.stated.wants(word, names[0]) for word in words)
        if len(first) != 1 or first == other or [r for r, _ in first] != [r for r, _ in other]:
            raise NotUnderstood(f"{self.scene.said.clause!r} asks two things: ask one at a time")
        ((relation, value),) = first
        rows = (Condition(relation=relation, subject=name, value=value) for name in names)
        self.asks(Question("whether", (), tuple(rows)))

    def on_whether_any(self, clause: Clause) -> None:
        assert clause.subject is not None
        if any(n.count is not None for n in clause.subject.items):
            raise NotUnderstood(f"{self.scene.said.clause!r} asks for a number: ask how many")
        names, own = self._asked_of(clause.subject)
        held = tuple(dict.fromkeys((*self._asked(clause, names), *own)))
        self.asks(Question("whether", names, held))

    def on_whether_has(self, clause: Clause) -> None:
        """`does Ben have the tablet?`"""
        held = next((a for a in clause.arguments if isinstance(a, Nouns)), None)
        assert clause.subject is not None and held is not None
        found = self.nouns.subjects(clause.subject, THINGS, "a person or a robot")
        holders = self.who.all_of(found)
        if len(holders) != 1:
            raise NotUnderstood(f"{self.scene.said.clause!r}: ask of one at a time")
        plain = replaced(clause, subject=held, arguments=(), predicate=None)
        if any(noun.quantity is Quantity.ANY for noun in held.items):
            names, own = self._asked_of(held)
            has = Condition(relation=self.scene.vocabulary.relation_to(holders[0]), subject="?",
                            value=holders[0])  # fmt: skip
            return self.asks(Question("whether", names, (has, *own)))
        assert plain.subject is not None
        rows = tuple(
            Condition(
                relation=self.scene.vocabulary.relation_to(holders[0]),
                subject=name,
                value=holders[0],
            )
            for name in self.who.all_of(self.nouns.subjects(held, THINGS, "an object"))
        )
        return self.asks(Question("whether", (), rows))

    def whether(self, conditions: Sequence[Condition]) -> None:
        """Ask whether that is so which a command would make so: "has anyone watered the fern?"."""
        if not conditions or any(c.any_of for c in conditions):
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say of whom it is asked")
        self.asks(Question("whether", (), tuple(conditions)))

    def on_who_at(self, clause: Clause) -> None:
        """`who is in the study?`"""
        self.asks(Question("who", (), self._asked(clause, ())))

    def on_doing(self, clause: Clause) -> None:
        """`what is the robot doing?`"""
        names, own = self._asked_of(clause.subject) if clause.subject else ((), ())
        if own:
            raise NotUnderstood(f"{self.scene.said.clause!r} is a question that is not understood")
        self.asks(Question("what doing", names))

    def on_able(self, clause: Clause) -> None:
        """`what can you do?`, `what is the hsr able to do?`"""
        robots: tuple[str, ...] = ()
        if clause.subject is not None:
            found = self.nouns.subjects(clause.subject, ("robot",), "a robot")
            robots = tuple(dict.fromkeys(n for subject in found for n in self._names(subject)))
        self.asks(Question("what able", robots))

    def ask_able(self, robots: Sequence[str], stages: Sequence[Holds]) -> None:
        """Whether robots have the skills to bring that about: "can Dusty wash dishes?"."""
        rows = tuple(dict.fromkeys(row for stage in stages for row in stage))
        self.asks(Question("what able", tuple(robots), rows))

    def on_who(self, clause: Clause) -> None:
        """`who has the book?`"""
        assert clause.subject is not None
        found = self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
        names = dict.fromkeys(name for subject in found for name in self._names(subject))
        held = tuple(Condition(relation=AT, subject=name, value="?") for name in names)
        self.asks(Question("who", (), held))


def _kinds_of(nouns: Nouns) -> Nouns:
    """The same without what the words say of each: states, and where they are."""
    plain = tuple(
        replaced(
            noun,
            adjectives=tuple(word for word in noun.adjectives if "SUP" in word.tags),
            relatives=(),
            places=(),
        )
        for noun in nouns.items
    )
    return replaced(nouns, items=plain)
