"""Orders that carry a program: a worker runs it, call by call, and tells what it did."""

from __future__ import annotations

from msgspec.structs import replace

from keyexpr_schema.keyspace import ORDER, ROBOT_STATE
from keyexpr_schema.payloads.motions import MotionKind
from keyexpr_schema.payloads.programs import ProgramEnd
from keyexpr_schema.payloads.robots import RobotActivity
from keyexpr_schema.payloads.tasks import OrderAddress, ReportState
from tests.support.polling import until
from tests.support.worker_world import Fleet, MakeFleet

FETCH = """
navigate(to="kitchen")
pick(object="cup_1", place="kitchen")
if ask("holding", "hsr") != "cup_1":
    fail("the cup is not in the hand")
navigate(to="hallway")
place(object="cup_1", place="hallway")
"""


def is_at(fleet: Fleet, name: str) -> str | None:
    return next(t.place for t in fleet.world.backend.truths() if t.object == name)


async def at_rest(fleet: Fleet, robot: str = "hsr") -> None:
    async def rests() -> bool:
        state = (await fleet.session.list(ROBOT_STATE, robot=robot)).values()
        return any(one.activity is RobotActivity.IDLE for one in state)

    await until(rests, "the robot is at rest")
    before = len(fleet.world.begun)
    order = await fleet.order(robot, "after", "navigate", to="kitchen")
    assert (await fleet.report(order)).state is ReportState.SUCCEEDED
    assert len(fleet.world.begun) >= before


async def test_a_program_is_carried_out_and_its_trace_stands_in_the_report(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        report = await fleet.report(await fleet.programmed("hsr", FETCH))
        assert report.state is ReportState.SUCCEEDED, report.reason
        assert is_at(fleet, "cup_1") == "hallway"
        trace = report.program
        assert trace is not None and trace.code == FETCH and trace.end is ProgramEnd.DONE
        calls = [(c.name, c.line, c.result, c.tries) for c in trace.calls]
        assert calls == [
            ("navigate", 2, None, 1),
            ("pick", 3, None, 1),
            ("ask", 4, "cup_1", 0),
            ("navigate", 6, None, 1),
            ("place", 7, None, 1),
        ]
        assert trace.calls[1].args == {"object": "cup_1", "place": "kitchen"}


async def test_what_a_call_brought_is_known_before_the_program_ends(fleet_of: MakeFleet) -> None:
    code = 'learn("counted", "kitchen", 3)\nnavigate(to="hallway")\nreplan("see there")'
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.paused = True
        order = await fleet.programmed("hsr", code)

        async def told() -> bool:
            fact = await fleet.fact("counted", "kitchen")
            return fact is not None and fact.value == 3

        await until(told, "what was learned")
        fleet.world.paused = False
        report = await fleet.report(order)
        assert (report.state, report.reason) == (ReportState.FAILED, "see there")
        assert report.retryable
        assert report.program is not None and report.program.end is ProgramEnd.REPLAN
        await at_rest(fleet)


async def test_a_skill_is_tried_again_and_what_fails_for_good_can_be_caught(
    fleet_of: MakeFleet,
) -> None:
    code = """
navigate(to="kitchen")
try:
    pick(object="cup_1", place="kitchen")
except RuntimeError as why:
    fail(f"no cup: {why}")
"""
    async with fleet_of({"hsr": {"grasp": (1, 2, 3)}}) as fleet, fleet.worker("hsr"):
        report = await fleet.report(await fleet.programmed("hsr", code))
        assert report.state is ReportState.FAILED and not report.retryable
        assert report.reason is not None and report.reason.startswith("no cup: ")
        assert report.program is not None and report.program.calls[1].tries == 3
        again = await fleet.report(await fleet.programmed("hsr", FETCH, task="t2"))
        assert again.state is ReportState.SUCCEEDED, again.reason


async def test_a_failure_that_is_not_caught_is_that_of_the_attempt(fleet_of: MakeFleet) -> None:
    code = 'navigate(to="kitchen")\npick(object="cup_1", place="kitchen")'
    async with fleet_of({"hsr": {"grasp": (1, 2, 3)}}) as fleet, fleet.worker("hsr"):
        report = await fleet.report(await fleet.programmed("hsr", code))
        assert report.state is ReportState.FAILED and report.retryable
        assert report.reason is not None
        assert report.reason.startswith("line 2: pick(cup_1, kitchen): ")
        assert report.program is not None and report.program.end is ProgramEnd.FAILED


HOSTILE = {
    "import socket": "the program: line 1: ",
    "open('/etc/passwd')": "the program: line 1: ",
    "while True:\n    pass": "the program was stopped: it ran for longer than",
    "x = [0] * 10**10": "the program was stopped: it took more than",
    "vacuum(place='kitchen')": "the program: line 1: Name `vacuum` used when not defined",
    "for n in range(10**6):\n    ask('at', 'cup_1')": "it made more than 300 calls",
    "pick(object='moon', place='kitchen')": "object must be a known object, not 'moon'",
    "eval('fly(1)')": "there is no skill fly",
    "eval('pick(3, 4, 5, 6)')": "pick takes object, place",
    "learn('at', 'moon', 'kitchen')": "nothing is called 'moon'",
    "learn('at', 'a/b', 'kitchen')": "'a/b'",
    "learn('at', 'cup_1', 'moon')": "nothing is called 'moon'",
    "learn('n', 'cup_1', float('nan'))": "no number that can be told",
    "eval('pick(10**5000, 3)')": "object is too large a number",
    "fail('no\\x1b[31m')": "no [31m",
}


async def test_hostile_programs_get_a_sentence_each_and_the_robot_is_at_rest(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        for number, (code, sentence) in enumerate(HOSTILE.items()):
            order = await fleet.programmed("hsr", code, task=f"h{number}")
            report = await fleet.report(order)
            assert report.state is ReportState.FAILED and not report.retryable, code
            assert report.reason is not None and sentence in report.reason, code
            assert "\n" not in report.reason
        assert {motion.kind for _, motion in fleet.world.begun} <= {MotionKind.STOW}
        await at_rest(fleet)


async def test_a_skill_that_the_robot_does_not_offer_cannot_be_called(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot"):
        code = "pick(object='cup_1', place='kitchen')"
        report = await fleet.report(await fleet.programmed("locobot", code))
        assert report.reason == "the program: line 1: Name `pick` used when not defined"
        code = "eval(\"pick(object='cup_1', place='kitchen')\")"
        report = await fleet.report(await fleet.programmed("locobot", code, task="t2"))
        assert report.reason is not None
        assert "this robot does not offer skill 'pick'" in report.reason


async def test_a_cancelled_program_stops_the_robot(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        order = await fleet.programmed("hsr", FETCH)
        await fleet.world.until_begun(lambda begun: any(m.place == "kitchen" for _, m in begun))
        fleet.world.paused = True  # it is not there before the word has come
        address = OrderAddress.of(order)
        await fleet.session.confirm(ORDER, address, replace(order, cancelled=True))
        await fleet.world.until_begun(lambda begun: begun[-1][1].kind is MotionKind.STOW)
        fleet.world.paused = False
        report = await fleet.report(order)
        assert report.state is ReportState.CANCELLED
        assert report.program is not None and report.program.end is ProgramEnd.INTERRUPTED
        await at_rest(fleet)


async def test_the_deadline_is_over_all_of_a_program(fleet_of: MakeFleet) -> None:
    code = 'for n in range(100):\n    navigate(to="kitchen")\n    navigate(to="hallway")'
    async with fleet_of() as fleet, fleet.worker("hsr"):
        report = await fleet.report(await fleet.programmed("hsr", code, deadline_s=60.0))
        assert report.state is ReportState.FAILED
        assert report.reason == "do was not done within its deadline of 60 s"
        await at_rest(fleet)
