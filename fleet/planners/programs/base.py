"""`ProgramWriter`: writes the program of a sentence; what it writes is rehearsed, whoever it is."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from dataclasses import dataclass

from msgspec.structs import replace

from fleet.core.model.world import WorldModel
from fleet.planners.base import NoPlan
from fleet.planners.programs.rehearsal import Rehearsed, rehearse
from keyexpr_schema.payloads.programs import Program

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProgramTask:
    """A sentence for a robot, with what it wants, in the world as it is."""

    program: Program
    world: WorldModel
    robot: str


class ProgramWriter(ABC):
    """Writes programs. A plug-in derives from this; it is used for the robots whose `model` is the
    name of its entry point."""

    name: str

    def write(self, task: ProgramTask) -> Program | NoPlan:
        """The program, rehearsed against the skill models; or why there is none. Never raises."""
        try:
            code = self._write(task)
        except Exception as error:  # a stranger's code
            _log.exception("writing a program")
            return NoPlan(f"{self.name} failed: {type(error).__name__}: {error}")
        if isinstance(code, NoPlan):
            return code
        written = replace(task.program, code=code, made_by=self.name)
        found = rehearse(written, task.world, task.robot)
        if not isinstance(found, Rehearsed):
            return NoPlan(f"the program that {self.name} wrote will not do: {found}")
        return replace(written, duration_s=found.seconds)

    @abstractmethod
    def _write(self, task: ProgramTask) -> str | NoPlan:
        """The text of a program that makes the sentence's conditions true, or why there is none."""
