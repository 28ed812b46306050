"""Programs written by a language model, and corrected by it until their rehearsal succeeds."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.llm.conversation import GivenUp, LanguageModel, Rejected
from fleet.llm.structured_output import StructuredAnswer, read_answer, schema_of
from fleet.planners.base import NoPlan
from fleet.planners.llm.prompt_text import problem_text, skills_text
from fleet.planners.programs.base import ProgramTask, ProgramWriter
from fleet.planners.programs.rehearsal import Rehearsed, callable_skills, rehearse, stubs_of
from keyexpr_schema.payloads.goals import Goal


class ProgramAnswer(StructuredAnswer, frozen=True):
    """A program's text."""

    code: str


class ModelWriter(ProgramWriter):
    """Asks the configured model; what is wrong with its program goes back to it."""

    name = "llm"

    def __init__(self, model: LanguageModel) -> None:
        self._model = model

    def _write(self, task: ProgramTask) -> str | NoPlan:
        wanted = Goal(
            goal="wanted",
            text=task.program.text,
            conditions=task.program.stages[-1] if task.program.stages else (),
        )
        skills = callable_skills(task.world, task.robot).values()
        made = self._model.ask(
            system="program-system",
            question="program",
            correction="program-repair",
            values={
                "stubs": stubs_of(task.world, task.robot),
                "skills": skills_text(skills),
                "problem": problem_text(task.world, (wanted,)),
            },
            schema=schema_of(ProgramAnswer),
            read=lambda text: _read(text, task),
        )
        return NoPlan(made.reason, made.violations) if isinstance(made, GivenUp) else made


def _read(text: str, task: ProgramTask) -> str | Rejected:
    answer = read_answer(text, ProgramAnswer)
    if isinstance(answer, str):
        return Rejected.because("malformed", answer)
    found = rehearse(replace(task.program, code=answer.code), task.world, task.robot)
    if not isinstance(found, Rehearsed):
        return Rejected.because("program", found)
    return answer.code
