"""A program in one attempt: what its calls do, its trace, how it goes on after a crash."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from msgspec.structs import replace

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.ids import check_id
from keyexpr_schema.payloads.programs import ProgramCall, ProgramEnd, ProgramTrace
from keyexpr_schema.payloads.tasks import Report, ReportState
from keyexpr_schema.payloads.world import Fact
from workers.errors import (
    BadArguments,
    ProgramRefused,
    ProgramStopped,
    SkillFailed,
    UnknownSkill,
)
from workers.orders.journal import FinishedCall
from workers.programs.sandbox import LIMITS, Call, Limits, one_line, run_sandboxed
from workers.programs.stubs import ASK, CALLS, FAIL, LEARN, REPLAN, callable_skills, stubs_of
from workers.skill_context import SkillContext
from workers.skill_registry import Skill, SkillRegistry

LONGEST_REASON = 400
RECOGNISED = 200
"""So many characters of a failure's reason tell it from what a program raises itself."""


class ProgramEnded(Exception):
    """The program ends here, and is not asked."""

    def __init__(self, end: ProgramEnd, reason: str, *, retryable: bool) -> None:
        super().__init__(reason)
        self.end, self.reason, self.retryable = end, reason, retryable


RunSkill = Callable[[Skill, dict[str, str | float]], Awaitable[Report]]
"""Carries out one skill call, with its tries; a report of how that ended."""


class ProgramRun:
    """Runs a program once. `finished` are the calls that an earlier run of the worker had finished:
    the program, which knows nothing but what its calls give, goes through them again without
    moving anything, up to where it was.

    `note` is told of every call that has ended, before the program hears of it.
    """

    def __init__(
        self,
        code: str,
        ctx: SkillContext,
        registry: SkillRegistry,
        offered: Callable[[], tuple[str, ...]],
        run_skill: RunSkill,
        note: Callable[[FinishedCall], Awaitable[None]],
        finished: tuple[FinishedCall, ...] = (),
        limits: Limits = LIMITS,
    ) -> None:
        self._code, self._ctx, self._limits = code, ctx, limits
        self._registry, self._offered = registry, offered
        self._run_skill, self._note = run_skill, note
        self._finished = finished
        self._calls: list[ProgramCall] = []
        self._failure: SkillFailed | None = None
        self._end: ProgramEnd | None = None
        self._reason: str | None = None
        for known in finished:
            ctx.recall(known.facts)

    @property
    def trace(self) -> ProgramTrace:
        """What it has done so far; `INTERRUPTED` until it has come to an end of its own."""
        end = ProgramEnd.INTERRUPTED if self._end is None else self._end
        return ProgramTrace(code=self._code, calls=tuple(self._calls), end=end, reason=self._reason)

    async def __call__(self) -> None:
        """Run it to its end.

        Raises:
            SkillFailed: it did not do what it was to do.
        """
        skills = [self._registry.get(name, self._offered()) for name in self._able()]
        try:
            printed = await run_sandboxed(self._code, stubs_of(skills), self._answer, self._limits)
        except ProgramEnded as ended:
            end, reason, retryable = ended.end, ended.reason, ended.retryable
        except ProgramRefused as refused:
            end, reason, retryable = ProgramEnd.REFUSED, f"the program: {refused}", False
        except ProgramStopped as stopped:
            end, reason, retryable = self._stopped(stopped)
        else:
            for line in printed.splitlines():
                self._ctx.log(f"program: {one_line(line, LONGEST_REASON)}")
            self._end = ProgramEnd.DONE
            return
        self._end, self._reason = end, reason
        raise SkillFailed(reason, retryable=retryable)

    def _able(self) -> tuple[str, ...]:
        known = {one.name for one in self._registry}
        return tuple(name for name in self._offered() if name in known)

    def _stopped(self, stopped: ProgramStopped) -> tuple[ProgramEnd, str, bool]:
        """A failed call that the program did not catch is its failure, else it is the program's."""
        failure, said = self._failure, str(stopped)
        if failure is not None and " ".join(failure.reason.split())[:RECOGNISED] in said:
            last = self._calls[-1]
            return (
                ProgramEnd.FAILED,
                f"line {last.line}: {_written(last)}: {failure.reason}",
                failure.retryable,
            )
        return ProgramEnd.STOPPED, f"the program was stopped: {said}", False

    async def _answer(self, call: Call) -> Value:
        args = self._named(call)
        number = len(self._calls) + 1
        if number <= len(self._finished):
            return self._repeated(self._finished[number - 1].call, call, args)
        began_s = self._ctx.now_s
        base = ProgramCall(
            number=number, name=call.name, args=_told(args), line=call.line, started_s=began_s
        )
        if call.name in (REPLAN, FAIL):
            reason = one_line(str(args["reason"]), LONGEST_REASON)
            await self._ended(base)
            raise ProgramEnded(
                ProgramEnd.REPLAN if call.name == REPLAN else ProgramEnd.FAILED,
                reason,
                retryable=call.name == REPLAN,
            )
        before = set(self._ctx.observed)
        if call.name == ASK:
            relation, subject = self._variable(call, args)
            done = replace(base, result=self._ctx.known(relation, subject))
        elif call.name == LEARN:
            self._learn(call, args)
            done = base
        else:
            done = await self._do(base, call, args)
        facts = tuple(fact for fact in self._ctx.observed if fact not in before)
        return self._given(await self._ended(done, facts))

    async def _ended(self, call: ProgramCall, facts: tuple[Fact, ...] = ()) -> ProgramCall:
        ended = replace(call, ended_s=self._ctx.now_s)
        await self._note(FinishedCall(call=ended, facts=facts))
        self._calls.append(ended)
        return ended

    def _given(self, call: ProgramCall) -> Value:
        if call.reason is not None:
            self._failure = SkillFailed(call.reason, retryable=call.retryable)
            raise self._failure
        return call.result

    def _repeated(self, known: ProgramCall, call: Call, args: Mapping[str, Any]) -> Value:
        if (known.name, known.args) != (call.name, _told(args)):
            raise ProgramEnded(
                ProgramEnd.INTERRUPTED,
                f"the program does not go on where it was: call {known.number} was "
                f"{_written(known)}",
                retryable=True,
            )
        self._calls.append(known)
        return self._given(known)

    async def _do(self, base: ProgramCall, call: Call, args: Mapping[str, Any]) -> ProgramCall:
        """Carry out a skill, under the same checks as an order of it."""
        try:
            skill = self._registry.get(call.name, self._offered())
            bound = skill.bind(
                {name: str(value) for name, value in args.items()}, self._ctx.robot, self._ctx.world
            )
        except (UnknownSkill, BadArguments) as error:
            raise self._wrong(call, str(error)) from None
        report = await self._run_skill(skill, bound)
        failed = report.state is not ReportState.SUCCEEDED
        return replace(
            base,
            tries=len(report.tries),
            reason=(report.reason or report.state.value) if failed else None,
            retryable=report.retryable,
        )

    def _named(self, call: Call) -> dict[str, Any]:
        """The arguments of a call by name."""
        parameters = CALLS.get(call.name)
        if parameters is None:
            skill = callable_skills(self._registry).get(call.name)
            if skill is None:
                raise self._wrong(call, f"there is no skill {call.name}")
            parameters = tuple(skill.parameters)
        if len(call.args) > len(parameters):
            raise self._wrong(call, f"{call.name} takes {', '.join(parameters) or 'nothing'}")
        named = dict(zip(parameters, call.args, strict=False))
        if twice := sorted(named.keys() & call.kwargs.keys()):
            raise self._wrong(call, f"{call.name}: {twice[0]} is given twice")
        named.update(call.kwargs)
        if call.name in CALLS and named.keys() != set(parameters):
            raise self._wrong(call, f"{call.name} takes {', '.join(parameters)}")
        for name, value in named.items():
            if value is not None and not isinstance(value, (str, bool, int, float)):
                raise self._wrong(call, f"{name} must be a word, a number or a truth value")
            if isinstance(value, int) and not -(2**53) <= value <= 2**53:
                raise self._wrong(call, f"{name} is too large a number")
            if isinstance(value, float) and value - value != 0.0:
                raise self._wrong(call, f"{name} is {value!r}, which is no number that can be told")
        return named

    def _variable(self, call: Call, args: Mapping[str, Any]) -> tuple[str, str]:
        relation, subject = args["relation"], args["subject"]
        try:
            if not isinstance(relation, str) or not isinstance(subject, str):
                raise self._wrong(call, "relation and subject must be names")
            return check_id(relation, "relation"), check_id(subject, "subject")
        except InvalidId as error:
            raise self._wrong(call, str(error)) from None

    def _learn(self, call: Call, args: Mapping[str, Any]) -> None:
        relation, subject = self._variable(call, args)
        world, value = self._ctx.world, args["value"]
        if not any(subject in known for known in (world.objects, world.places, world.specs)):
            raise self._wrong(call, f"{LEARN}: nothing is called {subject!r}")
        if isinstance(value, str) and len(value) > LONGEST_REASON:
            raise self._wrong(call, f"{LEARN}: a value has at most {LONGEST_REASON} characters")
        known = {*world.objects, *world.places, *world.specs}
        if relation == AT and value is not None and value not in known:
            raise self._wrong(call, f"{LEARN}: nothing is called {value!r:.80} where it could be")
        self._ctx.observe(relation, subject, value)

    def _wrong(self, call: Call, why: str) -> ProgramEnded:
        where = f"line {call.line}: " if call.line else ""
        return ProgramEnded(ProgramEnd.STOPPED, f"{where}{why}", retryable=False)


def traced(report: Report, program: ProgramRun | None) -> Report:
    """The report of an attempt with what its program did, if it was one."""
    return report if program is None else replace(report, program=program.trace)


def _told(args: Mapping[str, Any]) -> dict[str, Value]:
    """Arguments as the trace has them: short, and such as JSON can say."""
    return {name: _short(value) for name, value in args.items()}


def _short(value: Any) -> Value:
    if isinstance(value, str):
        clean = value.encode(errors="replace").decode()
        return clean if len(clean) <= LONGEST_REASON else clean[:LONGEST_REASON] + "…"
    if isinstance(value, float) and value - value != 0.0:
        return str(value)
    if isinstance(value, int) and not -(2**53) <= value <= 2**53:
        return f"{value:.3e}" if abs(value) < 10**300 else "a very large number"
    return value  # type: ignore[no-any-return]


def _written(call: ProgramCall) -> str:
    return f"{call.name}({', '.join(str(value) for value in call.args.values())})"
