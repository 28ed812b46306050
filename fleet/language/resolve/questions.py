"""Questions, as data for those who answer them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace as replace_nouns

from msgspec.structs import replace

from fleet.errors import NotUnderstood
from fleet.language.resolve.frames import framed
from fleet.language.resolve.ground import Ground
from fleet.language.resolve.mentions import Mention
from fleet.language.resolve.scene import PLACES, THINGS, Question
from fleet.language.resolve.states import of_each
from fleet.language.resolve.wishes import Wishes
from fleet.language.tree.nodes import (
    Clause,
)
from keyexpr_schema.facts import (
    AT,
    SEARCHED,
)
from keyexpr_schema.payloads.goals import Condition


class Questions:
    """Turns questions into data."""

    def __init__(self, ground: Ground, wishes: Wishes) -> None:
        self.scene, self.who, self.nouns, self.places = ground
        self.wishes = wishes

    def _asks(self, clause: Clause) -> None:
        if self.scene.mode:
            raise NotUnderstood(
                f"{self.scene.said.line!r} is a question; a {self.scene.mode} says what "
                f"{'should hold' if self.scene.mode == 'goal' else 'holds'}"
            )

    def ask_where(self, clause: Clause) -> None:
        """`where is the cup?`"""
        self._asks(clause)
        assert clause.subject is not None
        names = tuple(
            name
            for s in self.nouns.subjects(clause.subject, THINGS, "an object or a robot")
            for name in (s.names if not isinstance(s, Mention) else s.subjects)
        )
        self.scene.question = Question("where", names)

    def on_how_many(self, clause: Clause) -> None:
        """`how many plates are in the kitchen?`"""
        self._asks(clause)
        names = self._asked_of(clause)
        self.scene.question = Question("how many", names, self._asked(clause, names))

    def on_which(self, clause: Clause) -> None:
        """`which windows are open?`, `what is in the fridge?`"""
        self._asks(clause)
        names = self._asked_of(clause) if clause.subject is not None else ()
        self.scene.question = Question("which", names, self._asked(clause, names))

    def _asked_of(self, clause: Clause) -> tuple[str, ...]:
        assert clause.subject is not None
        types = THINGS if self.nouns.can_be(clause.subject, THINGS) else PLACES
        plain = replace_nouns(
            clause.subject,
            items=tuple(replace_nouns(n, adjectives=()) for n in clause.subject.items),
        )
        found = self.nouns.subjects(plain, types, "an object, robot or place")
        return tuple(
            dict.fromkeys(
                n for s in found for n in (s.names if not isinstance(s, Mention) else s.subjects)
            )
        )

    def _asked(
        self, clause: Clause, names: Sequence[str], negated: bool = False
    ) -> tuple[Condition, ...]:
        """What may be so of each of them, who are then called `?`."""
        predicate = clause.predicate
        arguments = predicate.arguments if predicate is not None else clause.arguments
        words = predicate.words if predicate is not None else ()
        if predicate is not None and predicate.kind == "done":
            if words[0].words not in self.scene.stated.states:
                if words[0].word in self.scene.tagger.book.searched:
                    return (Condition(relation=SEARCHED, subject="?", value=True),)
                raise NotUnderstood(
                    f"{self.scene.said.clause!r} is a question that is not understood"
                )
            if predicate.arguments:
                raise NotUnderstood(
                    f"{self.scene.said.clause!r} is a question that is not understood"
                )
        if words:
            held = {
                (relation, value)
                for relation, _, value in of_each(self.scene.stated, words, names[:1], negated)
            }
            return tuple(Condition(relation=r, subject="?", value=v) for r, v in sorted(held))
        if not arguments:
            return ()
        if negated:
            raise NotUnderstood(f"{self.scene.said.clause!r}: ask where they are, not where not")
        where, _ = self.wishes.whereto(framed(arguments))
        target = where.target or where.source
        if target is None:
            raise NotUnderstood(f"{self.scene.said.clause!r} does not say where")
        return (Condition(relation=where.relation, subject="?", value=target),)

    def on_whether(self, clause: Clause) -> None:
        """`is the door open?`"""
        self._asks(clause)
        assert clause.subject is not None
        if not clause.has("DET") and any(
            n.quantity.name != "THE" and not n.numbers and n.form == "noun" and n.determiner
            for n in clause.subject.items
        ):  # "are there any clean glasses?"
            names_of_any = self._asked_of(clause)
            held = self._asked(clause, names_of_any)
            states = [w for n in clause.subject.items for w in n.adjectives]
            rows = of_each(self.scene.stated, states, names_of_any[:1])
            told = tuple(Condition(relation=r, subject="?", value=v) for r, _, v in rows)
            self.scene.question = Question("whether", names_of_any, (*held, *told))
            return
        types = THINGS if self.nouns.can_be(clause.subject, THINGS) else PLACES
        mentions = [
            self.who.resolve(s)
            for s in self.nouns.subjects(clause.subject, types, "an object or a robot")
        ]
        names = [name for mention in mentions for name in mention.subjects]
        held = self._asked(clause, names)
        if any(mention.open for mention in mentions):
            self.scene.question = Question("whether", tuple(names), held)
            return
        self.scene.question = Question(
            "whether",
            (),
            tuple(replace(each, subject=name) for name in names for each in held),
        )

    def on_which_not(self, clause: Clause) -> None:
        """`which boxes aren't sealed?`"""
        self._asks(clause)
        names = self._asked_of(clause)
        self.scene.question = Question("which", names, self._asked(clause, names, True))

    def on_who_at(self, clause: Clause) -> None:
        """`who is in the study?`"""
        self._asks(clause)
        held = self._asked(clause, ())
        self.scene.question = Question("who", (), held)

    def on_doing(self, clause: Clause) -> None:
        """`what is the robot doing?`"""
        self._asks(clause)
        names = self._asked_of(clause) if clause.subject else ()
        self.scene.question = Question("what doing", names)

    def on_who(self, clause: Clause) -> None:
        """`who has the book?`"""
        self._asks(clause)
        held = tuple(Condition(relation=AT, subject=n, value="?") for n in self._asked_of(clause))
        self.scene.question = Question("who", (), held)
