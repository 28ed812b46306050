"""Who writes programs besides the symbolic planner: a language model, and a robot's own writer.
What they write is rehearsed against the skill models; the symbolic planner's is as good."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core.model.world import WorldModel
from fleet.jobshop.time_budget import TimeBudget
from fleet.llm.client import ModelClient
from fleet.llm.configuration import LlmConfig
from fleet.llm.conversation import LanguageModel
from fleet.planners import NoPlan, ProgramTask, ProgramWriter, SymbolicPlanner
from fleet.planners.programs.model import ModelWriter
from fleet.planners.programs.rehearsal import Rehearsed, rehearse
from fleet.planners.programs.writer import with_programs, write_program
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.programs import Program
from tests.support.household import at, fact, home
from tests.support.llm_server import LlmServer, Reply

BRING = Program(text="bring cup 1 to the hallway", stages=((at("cup_1", "hallway"),),))
GOOD = """navigate("kitchen")
pick("cup_1", "kitchen")
navigate(to="hallway")
place(object="cup_1", place="hallway")
"""
SIDE = """navigate("kitchen")
pick("cup_2", "kitchen")
navigate(to="hallway")
place(object="cup_2", place="hallway")
"""
AFTER = SIDE.replace("hallway", "living_room")
LOST = home(facts=(fact("cup_1", "at", None),))


def written(code: str) -> Program:
    return Program(text=BRING.text, stages=BRING.stages, code=code)


@pytest.mark.parametrize("world", [home(), home(cups=1), LOST], ids=["known", "one", "lost"])
def test_what_the_symbolic_planner_writes_does_in_rehearsal_what_it_should(
    world: WorldModel,
) -> None:
    made = write_program(BRING, world, "hsr", SymbolicPlanner(), TimeBudget(30.0))
    assert isinstance(made, Program)
    found = rehearse(made, world, "hsr")
    assert isinstance(found, Rehearsed), found
    assert 0.5 * made.duration_s <= found.seconds <= made.duration_s + 1.0


WRONG = {
    GOOD.replace('navigate("kitchen")\n', ""): "line 1: pick(cup_1, kitchen) cannot be done then",
    GOOD.replace("cup_1", "moon"): "line 2: pick: object must be a known movable",
    GOOD.rpartition("place(")[0]: "at(cup_1) = hallway does not hold when it has ended",
    "import socket": "socket",
    "while True:\n    pass": "turn time limit",
    "for n in range(10**6):\n    ask('at', 'cup_1')": "suspension limit",
    "import time\ntime.sleep(9)": "a program has no time.sleep",
    "fly()": "`fly` used when not defined",
    "eval('ask(1, 2, 3)')": "ask has other arguments",
    "replan('no idea')": "it gives up: no idea",
    "place_on_robot('cup_1', 'locobot', 'kitchen')": "cannot be done then",
    "learn('at', 'cup_1', 'hallway')": "at(cup_1) = hallway does not hold when it has ended",
    "learn('at', 'hsr', 'kitchen')\n" + GOOD.partition("\n")[2]: "at(hsr) should be kitchen",
    f"{SIDE}{GOOD}": "pick(cup_2, kitchen) does something to cup_2 that is not asked for",
    f"{GOOD}{AFTER}": "pick(cup_2, kitchen) does something to cup_2 that is not asked for",
    f"# \x1b[2J\n{GOOD}": "line 1: it has characters that nobody sees",
    f"# \u202e\n{GOOD}": "line 1: it has characters that nobody sees",
    f"x = '{'a' * 32_000}'": "it has 32006 characters",
    f"x = {'[' * 500}{']' * 500}": "too deeply nested",
}


@pytest.mark.parametrize("code", WRONG, ids=range(len(WRONG)))
def test_a_program_that_will_not_do_is_found_out_in_rehearsal(code: str) -> None:
    found = rehearse(written(code), home(), "hsr")
    assert isinstance(found, str) and WRONG[code] in found


def test_what_is_wrong_with_a_models_program_goes_back_to_it(model_client: ModelClient) -> None:
    first = GOOD.replace('navigate("kitchen")\n', "")
    with LlmServer(Reply({"code": first}), Reply({"code": GOOD})) as server:
        config = LlmConfig(model="openai/scripted", api_base=server.api_base, retries=0)
        writer = ModelWriter(LanguageModel(config, model_client))
        made = writer.write(ProgramTask(BRING, home(), "hsr"))
    assert isinstance(made, Program), made
    assert (made.code, made.made_by) == (GOOD, "llm")
    assert made.duration_s > 0.0
    asked = server.prompt(0)
    assert "def pick(object: str, place: str) -> None" in asked
    assert "bring cup 1 to the hallway" in asked and "at(cup_1) = hallway" in asked
    assert "line 1: pick(cup_1, kitchen) cannot be done then" in server.prompt(1)


def sentence() -> Plan:
    args = {"robot": "?x1", "text": BRING.text}
    task = Task(task="t1", skill="do", args=args, actor="x1", program=BRING)
    return Plan(plan="p", goals=(), conditions=(), tasks=(task,))


class Own(ProgramWriter):
    name = "own"

    def __init__(self, code: str) -> None:
        self._code = code

    def _write(self, task: ProgramTask) -> str | NoPlan:
        if not self._code:
            raise ZeroDivisionError("oh")
        return self._code


@pytest.mark.parametrize(("code", "by"), [(GOOD, "own"), ("fly()", "symbolic"), ("", "symbolic")])
def test_a_robots_own_writer_is_asked_first_and_the_symbolic_one_where_that_will_not_do(
    code: str, by: str
) -> None:
    planner = SymbolicPlanner()
    made = with_programs(sentence(), home(), planner, TimeBudget(30.0), {"hsr": (Own(code),)})
    assert isinstance(made, Plan)
    (task,) = made.tasks
    assert task.program is not None and task.program.made_by == by
    assert made.pins == {"x1": "hsr"}


def test_tasks_that_wait_for_each_other_are_left_to_the_checker() -> None:
    plan = sentence()
    plan = replace(plan, tasks=(replace(plan.tasks[0], after=("t1",)),))
    assert with_programs(plan, home(), SymbolicPlanner(), TimeBudget(30.0), {}) == plan
