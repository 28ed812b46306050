"""The sandbox: runs the text of a program in a process of its own, call by call.

pydantic-monty interprets a Python subset with no files, network, clock or modules of the host. It
checks the text against stubs first. Whatever the text says, `run_sandboxed` ends by returning or
by one sentence, and its process ends with it.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

from keyexpr_schema.facts import Value
from workers.errors import ProgramRefused, ProgramStopped, SkillFailed


@dataclass(frozen=True)
class Limits:
    """What a program may use. Calls and the host's time for them count for nothing but `calls`."""

    text_chars: int = 32_000
    calls: int = 300
    between_calls_s: float = 2.0
    """Wall seconds of its own from one call to the next."""
    in_all_s: float = 20.0
    """Wall seconds of its own in all."""
    memory_bytes: int = 64 * 2**20
    depth: int = 200
    printed_bytes: int = 16_384


LIMITS = Limits()
GRACE_S = 30.0
"""Wall seconds after which a process that says nothing at all is killed: its type check is not
under the limits above."""
LONGEST_SENTENCE = 400

_DIAGNOSTIC = re.compile(r"^[^:\n]*:(\d+):\d+: \w+(?:\[[\w-]+\])? (.*)$", re.MULTILINE)


class Call(NamedTuple):
    """A call that a program has paused at. `line` counts from 1; 0: not known."""

    name: str
    args: tuple[Any, ...]
    kwargs: dict[str, Any]
    line: int


class _Printed:
    """What a program prints. Once that is too much, whoever waits in `stop` stops waiting: the
    sandbox would let it go on printing until its time is over."""

    def __init__(self, most: int, stop: asyncio.Timeout) -> None:
        self._left = most
        self._stop = stop
        self._loop = asyncio.get_running_loop()
        self._texts: list[str] = []

    @property
    def too_much(self) -> bool:
        return self._left < 0

    @property
    def text(self) -> str:
        return "".join(self._texts)

    def __call__(self, stream: str, text: str) -> None:
        """Called by the sandbox, from any thread."""
        before, self._left = self._left, self._left - len(text.encode(errors="replace"))
        if self._left >= 0:
            self._texts.append(text)
        elif before >= 0:
            self._loop.call_soon_threadsafe(self._end)

    def _end(self) -> None:
        with suppress(RuntimeError):  # nobody waits any more
            self._stop.reschedule(self._loop.time())


async def run_sandboxed(
    code: str,
    stubs: str,
    answer: Callable[[Call], Awaitable[Value]],
    limits: Limits = LIMITS,
) -> str:
    """Run `code` to its end; what it printed. `answer` gives what a call returns.

    A `SkillFailed` of `answer` is a `RuntimeError` inside the program, which it may catch; any
    other exception of `answer` ends the program and is raised here.

    Raises:
        ProgramRefused: the text does not pass the checks; nothing of it was run.
        ProgramStopped: it broke a limit, asked for what no program may have, or raised something.
    """
    # Half of the weight of a worker that runs no program would be this.
    import pydantic_monty as monty

    _check_text(code, limits)
    until = asyncio.timeout(None)
    printed = _Printed(limits.printed_bytes, until)
    too_much = ProgramStopped(f"it printed too much: {limits.printed_bytes} bytes are allowed")
    # A clock, a sleep or a chance would make a program that is resumed another one.
    policy: monty.OSPolicy = {
        "datetime": "call_host",
        "sleep": "call_host",
        "random_start": {"seed": 0},
    }
    allowed: monty.ResourceLimits = {
        "max_turn_duration_secs": limits.between_calls_s,
        "max_feed_duration_secs": limits.in_all_s,
        "max_memory": limits.memory_bytes,
        "max_recursion_depth": limits.depth,
        "max_suspensions": limits.calls + 1,
    }
    try:
        async with (
            until,
            monty.AsyncMonty(max_processes=1, request_timeout=GRACE_S) as pool,
            pool.checkout(
                limits=allowed,
                type_check=True,
                type_check_stubs=stubs,
                type_check_format="concise",
                os_policy=policy,
            ) as session,
        ):
            state = await session.feed_start(code, print_callback=printed)
            calls = 0
            while not isinstance(state, monty.MontyComplete) and not printed.too_much:
                if not isinstance(state, monty.AsyncFunctionSnapshot):
                    state = await _unanswered(state)
                    continue
                line = _line(code, state.position)
                if state.function_name == "import_stubs":
                    state = await state.resume_not_handled()  # the type check then says no
                    continue
                if state.is_os_function:
                    raise ProgramStopped(
                        f"{_at(line)}a program has no {state.function_name}: it can only call "
                        "skills, ask, learn, replan and fail"
                    )
                if (calls := calls + 1) > limits.calls:
                    raise ProgramStopped(f"it made more than {limits.calls} calls")
                call = Call(state.function_name, state.args, state.kwargs, line)
                try:
                    value = await answer(call)
                except SkillFailed as failure:
                    error = RuntimeError(failure.reason)
                    state = await state.resume({"exception": error})
                else:
                    state = await state.resume({"return_value": value})
    except TimeoutError:
        if not printed.too_much:
            raise
        raise too_much from None
    except (monty.MontyTypingError, monty.MontySyntaxError) as error:
        raise ProgramRefused(_refusal(error)) from None
    except monty.MontyCrashedError as error:
        raise ProgramStopped(f"the sandbox ended over it: {_short(str(error))}") from None
    except monty.MontyRuntimeError as error:
        raise ProgramStopped(_stop(error, limits)) from None
    except monty.MontyError as error:
        raise ProgramStopped(_short(str(error))) from None
    if printed.too_much:
        raise too_much
    return printed.text


async def _unanswered(state: Any) -> Any:
    """A name that nobody defines is a `NameError`; a program has nothing to wait for."""
    import pydantic_monty as monty

    if isinstance(state, monty.AsyncNameLookupSnapshot):
        return await state.resume()
    raise ProgramStopped("a program has nothing to wait for: every call returns when it is done")


def _check_text(code: str, limits: Limits) -> None:
    if not code.strip():
        raise ProgramRefused("the program is empty")
    if len(code) > limits.text_chars:
        raise ProgramRefused(
            f"the program has {len(code)} characters; {limits.text_chars} are allowed"
        )
    try:
        code.encode()
    except UnicodeEncodeError:
        raise ProgramRefused("the program is not Unicode text") from None


def _refusal(error: Any) -> str:
    text = error.display()
    found = _DIAGNOSTIC.search(text)
    if found is None:
        return _short(str(error))
    more = len(_DIAGNOSTIC.findall(text)) - 1
    also = f" (and {more} more)" if more else ""
    return _short(f"{_at(int(found[1]))}{found[2].strip()}{also}")


def _stop(error: Any, limits: Limits) -> str:
    inner = error.exception()
    frames = error.traceback()
    where = _at(frames[-1].line if frames else 0)
    said = str(inner)
    if isinstance(inner, TimeoutError):
        return (
            f"it ran for longer than {limits.between_calls_s:g} s from one call to the next, or "
            f"{limits.in_all_s:g} s in all"
        )
    if isinstance(inner, MemoryError):
        return f"it took more than {limits.memory_bytes // 2**20} MiB of memory"
    if isinstance(inner, RecursionError):
        return f"{where}it calls itself more than {limits.depth} levels deep"
    if isinstance(inner, RuntimeError) and "suspension limit" in said:
        return f"it made more than {limits.calls} calls"
    name = "" if type(inner) is RuntimeError else f"{type(inner).__name__}: "
    return _short(f"{where}{name}{said}")


def _line(code: str, position: Any) -> int:
    if not position.filename or position.filename.startswith("<string"):
        return 0
    return code.encode()[: position.start].count(b"\n") + 1


def _at(line: int) -> str:
    return f"line {line}: " if line else ""


def _short(sentence: str) -> str:
    """On one line, and no longer than people read."""
    return one_line(sentence, LONGEST_SENTENCE)


def one_line(text: str, longest: int) -> str:
    """A text of a program on one line, without what would control a terminal."""
    flat = "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
    return flat if len(flat) <= longest else flat[: longest - 1] + "…"
