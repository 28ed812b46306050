"""Runs the commands of an engine, and says in a sentence what went wrong."""

from __future__ import annotations

import asyncio
import re
from asyncio.subprocess import DEVNULL, PIPE, STDOUT, Process
from collections.abc import AsyncIterator
from dataclasses import dataclass

from cli.deployment.engines import Step, Target
from cli.errors import NotDeployed
from keyexpr_schema.payloads.deployments import Deployment

SSH_FAILED, NO_SUCH_COMMAND = 255, 127
_ABOUT_HELP = re.compile(r"(See|Run) 'docker .*--help'.*")


@dataclass(frozen=True)
class Done:
    """How a command has ended; `said` is the last line that it has printed."""

    code: int
    said: str


async def run(step: Step, target: Target) -> Done:
    """Carry out a command to its end.

    Raises:
        NotDeployed: it could not be begun: there is no engine, or its host cannot be reached.
    """
    process = await _begin(step, stdin=step.stdin is not None, output=PIPE)
    try:
        text = None if step.stdin is None else step.stdin.encode()
        out, _ = await process.communicate(text)
    finally:
        await _end(process)
    done = Done(process.returncode or 0, _last(out))
    check_begun(done, target)
    return done


async def container_lines(
    record: Deployment, target: Target, count: int, *, follow: bool
) -> AsyncIterator[str]:
    """The last lines that a container has printed, and with `follow` those that come.

    Raises:
        NotDeployed: it has failed.
    """
    step = target.logs(record.container, count, follow=follow)
    process = await _begin(step, stdin=False, output=PIPE)
    last = ""
    try:
        assert process.stdout is not None
        # A line may be longer than the stream's own limit, so pieces are put together here.
        rest = b""
        while piece := await process.stdout.read(65536):
            *whole, rest = (rest + piece).split(b"\n")
            for line in whole:
                last = line.decode("utf-8", "replace").rstrip("\r")
                yield last
        if rest:
            yield rest.decode("utf-8", "replace")
        await process.wait()
    finally:
        await _end(process)
    done = Done(process.returncode or 0, last)
    check_begun(done, target)
    if done.code:
        raise NotDeployed(f"{target.engine.value} {target.where}: {plain(done.said)}")


def check_begun(done: Done, target: Target) -> None:
    """That somebody was there to carry a command out.

    Raises:
        NotDeployed: nobody was.
    """
    if target.over_ssh and done.code == SSH_FAILED:
        raise NotDeployed(f"{target.host} cannot be reached over ssh: {plain(done.said)}")
    if target.over_ssh and done.code == NO_SUCH_COMMAND:
        raise NotDeployed(f"there is no {target.engine.value} on {target.host}: install it there")


def plain(said: str) -> str:
    """An engine's own words, without what stands before them in the line."""
    words = said.strip()
    for before in ("Error response from daemon: ", "Error: ", "error: ", "docker: "):
        words = words.removeprefix(before)
    return words or "it failed, and did not say why"


async def _begin(step: Step, *, stdin: bool, output: int) -> Process:
    program = step.argv[0]
    try:
        return await asyncio.create_subprocess_exec(
            *step.argv, stdin=PIPE if stdin else DEVNULL, stdout=output, stderr=STDOUT
        )
    except (FileNotFoundError, PermissionError):
        raise NotDeployed(
            f"there is no {program} on this machine: install it, or say --on where else"
        ) from None


async def _end(process: Process) -> None:
    if process.returncode is None:
        process.terminate()
        await process.wait()


def _last(out: bytes) -> str:
    said = [line for line in out.decode("utf-8", "replace").splitlines() if line.strip()]
    # Beneath what was wrong Docker has a line about its help.
    telling = [line for line in said if not _ABOUT_HELP.fullmatch(line)]
    return (telling or said or [""])[-1]
