"""Laws of a plan's revisions: residual plan, repair, and reconciliation with what is under way.

Each is checked wherever a random mission comes to it: the residual plan and its repair when a
planning job begins, reconciliation when its answer comes, late and after other events.
"""

from __future__ import annotations

from collections import Counter

from hypothesis import example, given, settings
from hypothesis import strategies as st

from fleet.core import events
from fleet.core.events import Event
from fleet.core.indexes.plan_index import OUTSTANDING
from fleet.core.plan_entry import PlanEntry, PlanningJob
from fleet.core.planning_input import PlanningInput
from fleet.core.replan_reasons import ReplanScope
from fleet.core.revision.reconcile import Revision, reconcile
from fleet.core.revision.residual_plan import residual_plan
from keyexpr_schema.facts import HOLDING, NOTHING
from keyexpr_schema.ids import bound
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.requests import Control, ControlRequest, ReplanRequest
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskState
from tests.support.fleet_model import Answer, FleetModel
from tests.support.household import bring, carrier, manipulator
from tests.support.reached import Reached, reaches

UNFINISHED = {TaskState.WAITING, *OUTSTANDING}


class Watched(FleetModel):
    """A fleet whose plans' revisions are looked at."""

    def run(self, given: PlanningInput) -> Answer:
        job = given.job
        entry = self.state.plans.get(job.plan)
        answer = super().run(given)
        if entry is not None and job.residual is not None:
            gone = {r for r in entry.outcome.allocation.values() if not self.state.ready(r)}
            check_residual(entry, job.residual, gone, self.met)
            if isinstance(answer, events.PlanningSucceeded) and answer.repaired:
                check_repair(job, job.residual, answer, self.met)
        return answer

    def apply(self, event: Event) -> None:
        if isinstance(event, events.PlanningSucceeded):
            entry = self.state.plans.get(event.plan.plan)
            if entry is not None and entry.job is not None and entry.job.job == event.job:
                revision = reconcile(entry, event, self.state.world())
                check_reconciled(entry, event, revision, self.met)
        super().apply(event)


def content(task: Task) -> tuple[str, tuple[tuple[str, str], ...], str]:
    """What a task is, whatever it is called."""
    return task.skill, tuple(sorted(task.args.items())), task.actor


def check_residual(entry: PlanEntry, residual: Plan, gone: set[str], met: Counter[str]) -> None:
    anew = {actor for actor, robot in entry.outcome.allocation.items() if robot in gone}
    left = [
        task
        for task in entry.plan.tasks
        if (task.goal is None or task.goal in entry.plan.goals)
        and (task.actor in anew or entry.records[task.task].state not in ENDED_TASKS)
    ]
    # The same tasks in the same places, under names that no task of the plan has had.
    assert [content(task) for task in residual.tasks] == [content(task) for task in left]
    names = dict(zip((t.task for t in left), (t.task for t in residual.tasks), strict=True))
    assert len(set(names.values())) == len(names)
    assert not set(names.values()) & entry.records.keys(), "a name was used before"
    # And the order between them.
    for old, new in zip(left, residual.tasks, strict=True):
        assert set(new.after) == {names[before] for before in old.after if before in names}
        met["order kept"] += bool(new.after)
    # Who has begun stays; who is gone holds nobody.
    for actor, robot in residual.pins.items():
        assert robot not in gone or entry.plan.pins.get(actor) == robot
    actors = {task.actor for task in residual.tasks} - anew
    for record in entry.records.values():
        if record.actor in actors and record.state in OUTSTANDING:
            current = entry.outcome.allocation.get(record.actor) == record.robot
            assert not current or residual.pins[record.actor] == record.robot
            met["a begun actor stays"] += current
    met["an actor begins anew"] += bool(anew & {task.actor for task in residual.tasks})
    assert residual == residual_plan(entry, residual.revision, gone)


def check_repair(
    job: PlanningJob, residual: Plan, answer: events.PlanningSucceeded, met: Counter[str]
) -> None:
    missing = answer.left_out.keys() | answer.for_robots.keys()
    assert set(answer.plan.goals) | missing == set(job.goals)
    names = [task.task for task in answer.plan.tasks]
    assert len(set(names)) == len(names)
    before = {task.task: task for task in residual.tasks}
    kept = [task for task in answer.plan.tasks if task.task in before]
    broken = {task.goal for task in residual.tasks if task.task not in names}
    new = [task for task in answer.plan.tasks if task.task not in before]
    for task in kept:
        assert content(task) == content(before[task.task]), "repair changed what still works"
        assert set(task.after) == set(before[task.task].after) & set(names)
        assert task.goal not in broken, "half of a goal's tasks were kept"
    for task in new:
        assert task.goal not in {other.goal for other in kept} or task.goal is None
    assert not {task.actor for task in new} & {task.actor for task in residual.tasks}
    met["repaired: part kept, part new"] += bool(kept) and bool(new)
    met["repaired: a goal left out"] += bool(missing)
    met["reallocated"] += (
        not new and job.reason is not None and (job.reason.scope is ReplanScope.REALLOCATE)
    )


def check_reconciled(
    entry: PlanEntry, event: events.PlanningSucceeded, revision: Revision, met: Counter[str]
) -> None:
    names = [task.task for task in revision.plan.tasks]
    assert len(set(names)) == len(names), "two tasks have one name"
    renamed = dict(zip((t.task for t in event.plan.tasks), names, strict=True))
    for old, new in zip(event.plan.tasks, revision.plan.tasks, strict=True):
        assert new.after == tuple(renamed[before] for before in old.after)
        # A name that was there before is that of the same call by the same robot.
        if (known := entry.records.get(new.task)) is not None:
            args = {name: bound(v, event.allocation) for name, v in new.args.items()}
            assert (known.skill, known.args) == (new.skill, args)
            assert known.state is TaskState.WAITING or known.robot == event.allocation[new.actor]
    for name, was in entry.records.items():
        now = revision.records[name]
        if was.state in ENDED_TASKS:
            assert now.state is was.state, "what is over was undone"
            met["a finished task is one of the new plan"] += name in names
        elif was.state in OUTSTANDING:
            # What the new plan still wants goes on as it is; its order is not touched.
            order = (was.robot, was.attempt, was.revision, was.args, was.state)
            assert (now.robot, now.attempt, now.revision, now.args, now.state) == order
            met["under way, and goes on"] += name in names
        else:
            ends = name not in names
            assert (now.state is TaskState.CANCELLED) == ends
            met["a waiting task is kept"] += not ends
    unwanted = {n for n, r in entry.records.items() if r.state in OUTSTANDING and n not in names}
    assert set(revision.unwanted) == unwanted
    met["under way, and unwanted"] += bool(unwanted)
    for task in revision.plan.tasks:
        record = revision.records[task.task]
        if record.state in OUTSTANDING:
            # Nothing that comes before work under way is still to be done.
            for before in (*record.after, *record.behind):
                assert revision.records[before].state is not TaskState.WAITING
    met["done already"] += any(
        revision.records[name].state is TaskState.SUCCEEDED and name not in entry.records
        for name in names
    )


INTERESTING = (
    "order kept",
    "a begun actor stays",
    "an actor begins anew",
    "repaired: part kept, part new",
    "repaired: a goal left out",
    "reallocated",
    "under way, and goes on",
    "under way, and unwanted",
    "a waiting task is kept",
    "a finished task is one of the new plan",
    "done already",
    "work ended meanwhile",
    "another reason meanwhile",
    "ordered while a plan was made",
    "ordered meanwhile, and goes on",
)

Step = tuple[str, int]
STEPS = st.lists(
    st.tuples(
        st.sampled_from(
            ["succeed", "succeed", "succeed", "start", "answer", "answer", "fail", "lose", "return",
             "move", "delete", "replan", "add", "join", "confirm", "late"]
        ),
        st.integers(0, 11),
    ),
    min_size=8,
    max_size=35,
)  # fmt: skip


def do(model: Watched, what: str, pick: int, away: set[str]) -> None:
    orders = model.orders()
    if what == "answer" and model.answers:
        model.answer(pick)
    elif what in ("succeed", "start", "fail") and orders:
        getattr(model, what)(orders[pick % len(orders)])
    elif what == "confirm":
        for order in [order for order in orders if order.cancelled][:1]:
            model.cancelled(order)
    elif what == "lose":
        robots = sorted(model.state.robots)
        # Rather one with a cup in its hand: nobody else can bring that.
        loaded = [
            r for r in robots if getattr(model.state.fact(HOLDING, r), "value", NOTHING) != NOTHING
        ]
        robot = (loaded or robots)[pick % len(loaded or robots)]
        if robot not in away:
            away.add(robot)
            model.lose(robot)
    elif what == "return":
        for robot in sorted(away):
            model.return_(robot)
        away.clear()
    elif what == "move":
        model.learn(f"cup_{1 + pick % 3}", "at", ("kitchen", "hallway", "living_room")[pick // 4])
    elif what == "delete" and len(model.state.goals) > 1:
        model.receive(events.GoalDeleted, goal=sorted(model.state.goals)[0])
    elif what == "replan":
        request = ReplanRequest(request=f"q{len(model.journal)}", plan="plan-1", reason="so")
        model.receive(events.ReplanRequested, request=request)
    elif what == "add":
        added = ControlRequest(
            request=f"q{len(model.journal)}", control=Control.ADD_TASK, plan="plan-1",
            skill="navigate", args={"to": ("kitchen", "hallway", "living_room")[pick // 4]},
        )  # fmt: skip
        model.receive(events.ControlRequested, request=added)
    elif what == "join" and "r9" not in model.state.robots:
        model.receive(events.RobotRegistered, spec=manipulator("r9"))
        model.receive(events.WorkerConnected, robot="r9", incarnation="i1")
        model.learn("r9", "holding", "nothing")
    elif what == "late":
        model.time_s += 1000.0
        model.receive(events.TimerFired)


@reaches(*INTERESTING)
@settings(max_examples=100, deadline=None)
@given(st.booleans(), st.booleans(), STEPS)
# A robot is lost with a cup in its hand, and another has work of its own.
@example(False, True, [("succeed", 0), ("succeed", 0), ("lose", 0)])
# While a cup that was moved is planned for, a robot goes on with the next task.
@example(True, False, [("move", 4), ("succeed", 0), ("succeed", 0), ("answer", 0)])
def test_the_laws_of_revisions(
    reached: Reached, late: bool, second: bool, steps: list[Step]
) -> None:
    robots = (manipulator(), carrier(), *((manipulator("r2"),) if second else ()))
    model = Watched(robots, 3, late)
    model.plan(*(bring(n, ("hallway", "living_room")[n % 2]) for n in (1, 2, 3)))
    if late:
        model.answer()
    away: set[str] = set()
    for what, pick in steps:
        do(model, what, pick, away)
    reached.update(model.met)
