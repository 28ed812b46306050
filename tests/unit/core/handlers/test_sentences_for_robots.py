"""A task may be a sentence for a robot: a program is written for it, checked and ordered."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.programs import ProgramCall, ProgramEnd, ProgramTrace
from keyexpr_schema.payloads.requests import Answer, Control, ControlRequest
from keyexpr_schema.payloads.tasks import Order, ReportState, TaskState
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import bring, manipulator


def say(model: FleetModel, request: str = "c", /, **args: str) -> Answer:
    asked = ControlRequest(
        request=request, control=Control.ADD_TASK, plan="plan-1", skill="do", args=args
    )
    model.receive(events.ControlRequested, request=asked)
    return model.replies[request]


def program_order(model: FleetModel) -> Order:
    """The order of the sentence, as soon as the robot has come to it."""
    while not any(order.program for order in model.orders()):
        model.succeed(model.wanted()[0])
    return next(order for order in model.orders() if order.program)


def test_a_sentence_becomes_a_program_that_its_robot_is_ordered_to_run() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    assert say(model, robot="hsr", text="bring cup 2 to the living room").accepted
    order = program_order(model)
    assert (order.robot, order.skill) == ("hsr", "do")
    assert order.program is not None and order.program.made_by == "symbolic"
    code = order.program.code
    assert code.startswith("# bring cup 2 to the living room\n")
    assert 'place(object="cup_2", place="living_room")' in code
    assert [step.skill for step in order.program.steps] == ["navigate", "pick", "navigate", "place"]
    assert order.deadline_s > order.program.duration_s
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED
    at_end = model.state.fact("at", "cup_2")
    assert at_end is not None and at_end.value == "living_room"


def test_what_a_program_did_stands_in_the_record_of_its_task() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    say(model, text="bring cup 2 to the living room")
    order = program_order(model)
    trace = ProgramTrace(code="…", end=ProgramEnd.FAILED, reason="no")
    model.report(order, ReportState.FAILED, reason="no", retryable=False, program=trace)
    record = model.plans["plan-1"].records[order.task]
    assert (record.state, record.trace) == (TaskState.FAILED, trace)


def test_a_sentence_whose_program_asks_for_another_gets_one_for_what_is_known_then() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    say(model, robot="hsr", text="bring cup 2 to the living room")
    first = program_order(model)
    model.start(first)
    model.learn("cup_2", "at", None)
    model.report(first, ReportState.FAILED, reason="nobody knows where cup_2 is now")
    second = program_order(model)
    assert second.program is not None and second.task != first.task
    assert 'if ask("at", "cup_2") is None:' in second.program.code
    assert "search(place=name_1)" in second.program.code
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED


def test_a_program_that_always_asks_for_another_is_given_up() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    say(model, robot="hsr", text="bring cup 2 to the living room")
    tried = 0
    while model.plans["plan-1"].state is PlanState.RUNNING:
        order = model.wanted()[0]
        if order.program is None:
            model.succeed(order)
        else:
            tried += 1
            model.fail(order, "try another way")
        assert tried < 20
    assert tried == 6


def test_a_program_that_says_it_is_done_and_has_not_done_it_counts_as_failed() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    say(model, robot="hsr", text="bring cup 2 to the living room")
    order = program_order(model)
    model.start(order)
    model.learn("cup_2", "at", "kitchen")
    record = model.plans["plan-1"].records[order.task]
    said = tuple(
        fact
        for fact in model.facts_after(order)
        if (fact.relation, fact.subject) != ("at", "cup_2")
    )
    still = [f for f in model.state.facts.values() if f.key == ("at", "cup_2")]
    model.report(order, ReportState.SUCCEEDED, facts=(*said, *still), ended_s=model.time_s)
    record = model.plans["plan-1"].records[order.task]
    assert record.state is TaskState.FAILED
    assert record.reason == "at(cup_2) = living_room does not hold"


def test_a_sentence_that_cannot_be_a_task_is_refused_with_the_reason() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    refusals = {
        "c1": ({"text": "frobnicate the cup"}, "'frobnicate the cup': "),
        "c2": ({"robot": "hsr"}, 'do takes text="a sentence"'),
        "c3": (
            {"robot": "nobody", "text": "bring cup 2 to the hallway"},
            "there is no robot nobody",
        ),
        "c4": ({"robot": "locobot", "text": "bring cup 2 to the hallway"}, "locobot"),
        "c5": ({"text": "bring cup 2 to the hallway", "speed": "fast"}, "do takes text="),
    }
    for request, (args, sentence) in refusals.items():
        answer = say(model, request, **args)
        assert not answer.accepted and sentence in answer.sentence
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED


def test_what_a_call_of_a_program_shows_to_be_hopeless_is_left_to_another_robot() -> None:
    model = FleetModel((manipulator("r1"), manipulator("r2")), cups=1)
    model.plan(bring(1, "hallway"), programs=True)
    (order,) = model.orders()
    assert order.program is not None
    other = {"r1": "r2", "r2": "r1"}[order.robot]
    model.start(order)
    model.learn(order.robot, "at", "kitchen")
    call = ProgramCall(
        number=2,
        name="pick",
        args={"object": "cup_1", "place": "kitchen"},
        reason="too slippery for it",
        retryable=False,
    )
    trace = ProgramTrace(code="…", calls=(call,), end=ProgramEnd.FAILED)
    model.report(order, ReportState.FAILED, reason="no", retryable=False, program=trace)
    (again,) = model.wanted()
    assert again.robot == other
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED
