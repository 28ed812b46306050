"""Rehearsals: a program is run against the skill models before it is ordered, whoever wrote it.

The text runs in the sandbox that workers use. Its skill calls move nothing: they are checked
against their models, in the facts as they are, and make true there what the models say. What a
program only tells (`learn`) it can ask for, and it makes nothing true: who says that the cup is in
the hallway has not brought it there. Where it is not known where something is, it is rehearsed for
every place where that may be. What moves or changes something that its sentence does not ask for,
and need not for it, is refused: as in plans, by action elimination.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from dataclasses import replace as changed
from typing import Any, NamedTuple

from fleet.core.model.derived import is_located
from fleet.core.model.eligibility import lacks
from fleet.core.model.preconditions import made_true, unmet_before
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel, condition_holds
from fleet.llm.quoting import printable
from keyexpr_schema.facts import AT, SEARCHED, FactKey, Literal, Value
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.programs import Program

CALLS = 300
LIMITS = {
    "max_turn_duration_secs": 2.0,
    "max_feed_duration_secs": 10.0,
    "max_memory": 64 * 2**20,
    "max_recursion_depth": 200,
    "max_suspensions": CALLS,
}
"""Those of workers (`workers/programs/sandbox.py`), and less time."""
MOST_CHARACTERS = 32_000
"""As many as a worker takes."""
MOST_WORLDS = 8
"""Where one thing may be: more places are not rehearsed."""

BASICS = """from typing import NoReturn
def ask(relation: str, subject: str) -> str | bool | float | None: ...
def learn(relation: str, subject: str, value: str | bool | float | None) -> None: ...
def replan(reason: str) -> NoReturn: ...
def fail(reason: str) -> NoReturn: ...
"""


@dataclass(frozen=True)
class Rehearsed:
    """How long a program takes at most [s], as far as models know."""

    seconds: float


class _Ended(Exception):
    """The program gives up; the message says why."""


class _Wrong(Exception):
    """A call that could not be carried out; the message says why."""


def stubs_of(world: WorldModel, robot: str) -> str:
    """What a robot's programs may call, as a stub file."""
    skills = callable_skills(world, robot).values()
    return BASICS + "".join(
        f"def {s.name}({', '.join(f'{name}: str' for name in _own(s))}) -> None: ...\n"
        for s in skills
    )


def callable_skills(world: WorldModel, robot: str) -> dict[str, SkillModel]:
    """The skills of a robot that a program can call, by name."""
    offered = world.robots[robot].skills
    return {n: world.skills[n] for n in offered if n in world.skills and n.isidentifier()}


def rehearse(program: Program, world: WorldModel, robot: str) -> Rehearsed | str:
    """How long the program takes, or what is wrong with it, as a sentence."""
    if unfit := _unfit(program.code):
        return unfit
    seconds, given_up = 0.0, ""
    reached = False
    for facts, hidden in _worlds(program, world):
        run = _Rehearsal(changed(world, facts=dict(facts)), robot, dict(hidden))
        wrong = run.of(program.code)
        if isinstance(wrong, _Ended):
            given_up = f"it gives up: {wrong}"
            if not hidden:
                return given_up
            continue
        if wrong is not None:
            return wrong
        stage = program.stages[-1] if program.stages else ()
        for condition in stage:
            if not condition_holds(run.facts, condition, run.world):
                return f"{condition} does not hold when it has ended"
        if needless := run.needless(program.stages, facts):
            return needless
        reached, seconds = True, max(seconds, run.seconds)
    return Rehearsed(seconds) if reached else given_up


def _unfit(code: str) -> str | None:
    """Why a text is not even run, whatever it says."""
    if len(code) > MOST_CHARACTERS:
        return f"it has {len(code)} characters; {MOST_CHARACTERS} are allowed"
    for number, line in enumerate(code.splitlines(), 1):
        if printable(plain := line.replace("\t", " ")) != plain:
            return f"line {number}: it has characters that nobody sees, or that steer a terminal"
    return None


def _worlds(
    program: Program, world: WorldModel
) -> Iterable[tuple[Mapping[FactKey, Value], Mapping[str, str]]]:
    """The facts, and what they hide: where a thing is that nobody knows where it is."""
    subjects = (s for stage in program.stages for c in stage for s in c.subjects)
    lost = [
        name
        for name in dict.fromkeys(subjects)
        if name in world.objects and not is_located(name, world.facts.get, world)
    ]
    if not lost:
        yield world.facts, {}
        return
    for place in list(world.places)[:MOST_WORLDS]:
        yield world.facts, dict.fromkeys(lost, place)


class _Done(NamedTuple):
    """A skill call that was carried out: its line, its words, what it is."""

    line: int
    call: str
    action: Action


@dataclass
class _Rehearsal:
    world: WorldModel
    robot: str
    hidden: dict[str, str]
    seconds: float = 0.0
    line: int = 0
    told: dict[FactKey, Value] = field(default_factory=dict)
    done: list[_Done] = field(default_factory=list)
    facts: dict[FactKey, Value] = field(init=False)

    def __post_init__(self) -> None:
        self.facts = dict(self.world.facts)

    def of(self, code: str) -> _Ended | str | None:
        """Run it; how it gave up, what is wrong, or nothing."""
        import pydantic_monty as monty

        stubs = stubs_of(self.world, self.robot)
        policy: Any = {"datetime": "call_host", "sleep": "call_host", "random_start": {"seed": 0}}
        limits: Any = LIMITS
        try:
            with (
                monty.Monty(max_processes=1, request_timeout=30.0) as pool,
                pool.checkout(
                    limits=limits,
                    type_check=True,
                    type_check_stubs=stubs,
                    type_check_format="concise",
                    os_policy=policy,
                ) as session,
            ):
                state = session.feed_start(code, print_callback=monty.CollectString(16_384))
                while not isinstance(state, monty.MontyComplete):
                    if isinstance(state, monty.NameLookupSnapshot):
                        state = state.resume()
                    elif not isinstance(state, monty.FunctionSnapshot):
                        return "a program has nothing to wait for"
                    elif state.function_name == "import_stubs":
                        state = state.resume_not_handled()
                    elif state.is_os_function:
                        return f"a program has no {state.function_name}"
                    else:
                        self.line = code.encode()[: state.position.start].count(b"\n") + 1
                        value = self._call(state.function_name, state.args, state.kwargs)
                        state = state.resume({"return_value": value})
        except _Ended as ended:
            return ended
        except _Wrong as wrong:
            return f"line {self.line}: {wrong}"
        except monty.MontyTypingError as error:
            return " ".join(error.display().split())[:400]
        except (monty.MontyError, UnicodeEncodeError) as error:
            return " ".join(str(error).split())[:400]
        return None

    def _call(self, name: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Value:
        basic = _BASIC.get(name)
        if basic is not None:
            try:
                return basic(self, *args, **kwargs)
            except TypeError:
                raise _Wrong(f"{name} has other arguments") from None
        skill = callable_skills(self.world, self.robot).get(name)
        if skill is None:
            raise _Wrong(f"{self.robot} has no skill {name}")
        given = {**dict(zip(_own(skill), map(str, args), strict=False)), **kwargs}
        bound = {n: str(given.get(n, "")) for n in _own(skill)}
        for parameter, value in bound.items():
            if not self.world.is_of_type(value, skill.types[parameter]):
                kind = skill.types[parameter]
                raise _Wrong(f"{name}: {parameter} must be a known {kind}, not {value!r}")
        action = skill.ground({**bound, skill.actor_parameter: self.robot})
        now = changed(self.world, facts=self.facts)
        why = lacks(now, self.robot, action, skill.actor_parameter) or unmet_before(action, now)
        if why:
            raise _Wrong(f"{name}({', '.join(bound.values())}) cannot be done then: {why}")
        here = self.facts.get(FactKey(AT, self.robot))
        self.seconds += now.duration_s(action, here, self.robot)
        self.done.append(_Done(self.line, f"{name}({', '.join(bound.values())})", action))
        self._comes_true(self._effects(action, self.facts))
        return None

    def _effects(self, action: Action, facts: Mapping[FactKey, Value]) -> list[Literal]:
        """What an action makes true, and what of the hidden things comes to light."""
        made = list(made_true(action, facts, changed(self.world, facts=dict(facts))))
        for (relation, spot), seen in action.after:
            if relation == SEARCHED and seen is True:
                found = (thing for thing, where in self.hidden.items() if where == spot)
                made += [Literal(FactKey(AT, thing), spot) for thing in found]
        return made

    def needless(
        self, stages: Sequence[tuple[Condition, ...]], start: Mapping[FactKey, Value]
    ) -> str | None:
        """The first call that does something to what nobody asks for, and without which (and what
        can then not be done) all would be reached as well; in a sentence."""
        asked = {s for stage in stages for row in stage for s in row.subjects} | {self.robot}
        for at, (line, call, action) in enumerate(self.done):
            keys = (*(key for key, _ in action.after), *(e.variable for e in action.conditional))
            touched = {key.subject for key in keys if key.relation != SEARCHED} - asked
            if touched and self._is_reached(stages, start, without=at):
                what = " and ".join(sorted(touched))
                return f"line {line}: {call} does something to {what} that is not asked for"
        return None

    def _is_reached(
        self,
        stages: Sequence[tuple[Condition, ...]],
        start: Mapping[FactKey, Value],
        without: int,
    ) -> bool:
        facts, passed = dict(start), 0
        for number, (_, _, action) in enumerate(self.done):
            now = changed(self.world, facts=facts)
            if number == without or (number > without and unmet_before(action, now)):
                continue
            facts.update(self._effects(action, facts))
            while passed < len(stages) - 1 and self._hold(stages[passed], facts):
                passed += 1
        return passed >= len(stages) - 1 and self._hold(stages[-1], facts) if stages else True

    def _hold(self, stage: tuple[Condition, ...], facts: Mapping[FactKey, Value]) -> bool:
        now = changed(self.world, facts=dict(facts))
        return all(condition_holds(facts, row, now) for row in stage)

    def _comes_true(self, literals: Iterable[tuple[FactKey, Value]]) -> None:
        for key, value in literals:
            self.facts[key] = value
            self.told.pop(key, None)

    def ask(self, relation: str, subject: str) -> Value:
        """What is known."""
        key = FactKey(relation, subject)
        return self.told.get(key, self.facts.get(key))

    def learn(self, relation: str, subject: str, value: Value) -> Value:
        """Something is said to be so from now on."""
        self.told[FactKey(relation, subject)] = value
        return None

    def give_up(self, reason: str) -> Value:
        """The program ends."""
        raise _Ended(str(reason)[:200])


_BASIC: dict[str, Callable[..., Value]] = {
    "ask": _Rehearsal.ask,
    "learn": _Rehearsal.learn,
    "replan": _Rehearsal.give_up,
    "fail": _Rehearsal.give_up,
}


def _own(skill: SkillModel) -> tuple[str, ...]:
    """A skill's parameters but the robot that does it."""
    return tuple(name for name in skill.parameters if name != skill.actor_parameter)
