"""Clauses, each to the part that knows its kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fleet.errors import NotUnderstood
from fleet.language.refusals import one_of
from fleet.language.resolve.claims import Claims
from fleet.language.resolve.frames import SAY_IT, no_fact
from fleet.language.resolve.goals.commands import Commands
from fleet.language.resolve.goals.deeds import deeds_of
from fleet.language.resolve.goals.ellipsis import Continuations
from fleet.language.resolve.goals.forbidding import Forbidding
from fleet.language.resolve.goals.shall import Shall
from fleet.language.resolve.ground import ground_of
from fleet.language.resolve.questions import Questions
from fleet.language.resolve.scene import Scene
from fleet.language.tree.nodes import Argument, Clause, Nouns, Place
from fleet.language.words.tokens import words_in

_STATES = frozenset({"shall_be", "wanted", "belongs", "bare", "bare_state", "named", "needs"})
"""Kinds of clauses that say what shall be so, rather than what shall be done."""
_GO_ON = frozenset({"bare", "bare_state", "whereto", "named"})
"""Kinds of clauses that say more of what whoever was told to do something shall do."""
_COMMANDS = _STATES | {"do", "told", "needs_doing"}
_REPEATED = frozenset({
    "do", "told", "needs_doing", "shall_be", "kept", "never_do", "never_be", "being", "whether",
    "belongs",
})  # fmt: skip
"""Kinds of clauses that can be said of something else, too."""
_WISHES = frozenset(
    words_in(
        "wanted belongs whereto enough kept never_be never_do avoid needs needs_doing not_allowed"
    )
)


class Clauses:
    """Takes clauses into what is said, one after the other."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        ground = ground_of(scene)
        deeds = deeds_of(ground)
        claims, questions = Claims(ground, deeds.wishes), Questions(ground, deeds.wishes)
        shall, commands = Shall(deeds, claims), Commands(deeds, questions)
        forbidding = Forbidding(deeds)
        ellipsis = Continuations(ground, deeds.wishes, claims, commands)
        self.topic = ellipsis.topic
        self.questions = questions
        self._by_kind: dict[str, Callable[[Clause], None]] = {
            name.removeprefix("on_"): getattr(part, name)
            for part in (claims, questions, shall, commands, forbidding, ellipsis)
            for name in vars(type(part))
            if name.startswith("on_")
        }

    def clause(self, clause: Clause) -> None:
        """Take a clause into what is said.

        Raises:
            NotUnderstood: it means nothing here; one sentence.
        """
        said = self.scene.said
        said.began, said.ended = clause.first, clause.last
        if clause.kind == "likewise":
            clause = self._likewise(clause)
        clause = self._with_front(clause)
        if clause.kind not in _GO_ON:
            said.draft.by = ()
        if hasattr(self.questions, f"on_{clause.kind}"):
            self.questions.check_mode()
        if self.scene.mode == "fact" and clause.kind in ("do", "told"):
            what = clause.verb.text if clause.verb is not None else said.clause
            raise NotUnderstood(f"{what!r} says what to do and not what is so: {SAY_IT}")
        if self.scene.mode == "fact" and clause.kind in _WISHES:
            raise no_fact(said.clause)
        self._by_kind[clause.kind](clause)
        if clause.kind != "remarked":
            self.scene.said.same = clause if clause.kind in _REPEATED else None
        if clause.kind != "bare_state":
            self.scene.said.keeps = clause.kind if clause.kind in ("kept", "never_be") else ""
        self.scene.said.done |= clause.kind not in _STATES
        self.scene.said.clauses += clause.kind != "remarked"
        said = self.scene.said
        for mention, wants in said.extra:
            if self.scene.mode == "fact" or clause.kind not in _COMMANDS:
                raise NotUnderstood(f"it is not known whether {one_of(mention.subjects)} is so")
            for relation, value in wants:
                said.draft.add(relation, mention, value)
        said.extra = []

    def _with_front(self, clause: Clause) -> Clause:
        """The clause with what stands before it, or before one that it goes on from.

        Raises:
            NotUnderstood: what stands before it says nothing of it.
        """
        said = self.scene.said
        if clause.front and clause.verb is not None:
            said.front = clause.front
            return replace(clause, arguments=(*clause.arguments, *clause.front))
        said.front = clause.front or said.front
        there = tuple(place for place in said.front if place.role in ("in", "from"))
        if clause.front and clause.front != there:
            text = said.quote(clause.front[0].first, clause.front[-1].last)
            raise NotUnderstood(f"{text!r} says nothing of what follows it")
        if clause.kind not in _COMMANDS and not clause.front:
            return clause
        if clause.verb is None:
            subject = clause.subject and self._found_at(clause.subject, there)
            return replace(clause, subject=subject)
        named = {a.role for a in clause.arguments if isinstance(a, Place)}
        more = [p for p in said.front if p not in there and p.role not in named]
        arguments: list[Argument] = [
            self._found_at(a, there) if isinstance(a, Nouns) else a for a in clause.arguments
        ]
        for i, a in enumerate(arguments):
            alone = not any(isinstance(b, Nouns) for b in arguments)  # "turn off the lights"
            if alone and isinstance(a, Place) and a.nouns and a.role in ("from", "for"):
                arguments[i] = replace(a, nouns=self._found_at(a.nouns, there))
        return replace(clause, arguments=(*arguments, *more))

    def _likewise(self, clause: Clause) -> Clause:
        """`the same with the plate`: the clause before, said of what is named now.

        Raises:
            NotUnderstood: nothing was said before that goes for something else as well.
        """
        before: Clause | None = self.scene.said.same
        named = clause.subject
        if before is not None and named is not None and before.verb is None:
            return replace(before, subject=named, front=())
        arguments: list[Argument] = list(before.arguments) if before is not None else []
        of = [i for i, a in enumerate(arguments) if isinstance(a, Nouns)]
        of = of or [i for i, a in enumerate(arguments) if isinstance(a, Place) and a.nouns]
        if before is None or named is None or not of:
            text = self.scene.said.clause
            raise NotUnderstood(f"{text!r} is said of nothing before it: say what shall be done")
        at = of[-1] if isinstance(arguments[of[0]], Nouns) else of[0]
        whom = arguments[at]
        arguments[at] = replace(whom, nouns=named) if isinstance(whom, Place) else named
        return replace(before, arguments=tuple(arguments), front=())

    @staticmethod
    def _found_at(nouns: Nouns, places: tuple[Place, ...]) -> Nouns:
        """The same, of those that are there, where their own words do not say where they are."""
        items = [
            replace(noun, places=places)
            if noun.form in ("noun", "general") and not noun.places and not noun.relatives
            else noun
            for noun in nouns.items
        ]
        return replace(nouns, items=tuple(items))
