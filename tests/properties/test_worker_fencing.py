"""Laws of a worker's fencing: whatever is delivered, whenever it crashes, no attempt runs twice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from keyexpr_schema.payloads.tasks import Order, ReportState
from tests.support.reached import Reached, reaches
from workers.orders.fencing import (
    Accept,
    Attempt,
    AttemptName,
    Cancel,
    Ignore,
    Ledger,
    Phase,
    Refuse,
    Renew,
    Repeat,
    decide,
    superseded,
)
from workers.orders.journal import Journal, Retention
from workers.orders.outbox import make_report

small = st.integers(1, 3)


def numbered(order: Order) -> Order:
    """The order with the serial that the second lineage gives its attempt: rising, never twice."""
    if order.planner != "numbering":
        return replace(order, serial=0)
    task = (order.plan == "q") * 2 + (order.task == "t2")
    return replace(order, serial=4 * order.attempt + task)


orders = st.builds(
    Order,
    robot=st.just("hsr"),
    planner=st.sampled_from([None, "counting", "numbering"]),
    plan=st.sampled_from(["p", "q"]),
    task=st.sampled_from(["t1", "t2"]),
    revision=small,
    attempt=small,
    epoch=small,
    skill=st.just("navigate"),
    args=st.just({"robot": "hsr", "to": "kitchen"}),
    deadline_s=st.just(60.0),
    cancelled=st.booleans(),
).map(numbered)


class Fenced:
    """The shell's use of `decide`, with everything on disk that the journal would have there."""

    def __init__(self) -> None:
        self.ledger = Ledger()
        self.queue: list[AttemptName] = []
        self.running: AttemptName | None = None
        self.started: list[AttemptName] = []
        self.epoch = 0
        self.met: set[str] = set()

    def end(self, name: AttemptName, state: ReportState) -> None:
        order = self.ledger.attempts[name].order
        report = make_report(order, "r1", state)
        self.ledger.put(Attempt(order, Phase.ENDED, report))

    def deliver(self, order: Order) -> None:
        name = AttemptName.of(order)
        before = self.ledger.attempts.get(name)
        older = order.epoch < self.ledger.epoch or order.revision < self.ledger.revisions.get(
            name.in_plan, 0
        )
        decision = decide(self.ledger, order)
        self.met.add(type(decision).__name__)
        assert self.ledger.attempts.get(name) is before, "deciding changes nothing"
        if before is not None and before.phase is Phase.ENDED:
            assert decision == Repeat(before.report)
        if older:
            assert isinstance(decision, (Refuse, Ignore, Repeat))
        match decision:
            case Accept():
                assert not order.cancelled
                assert order.attempt > max(
                    (done.attempt for done in self.started if done.of_task == name.of_task),
                    default=0,
                )
                for past in superseded(self.ledger, order):
                    if past in self.queue:
                        self.met.add("superseded in the queue")
                        self.queue.remove(past)
                        self.end(past, ReportState.CANCELLED)
                self.ledger.put(Attempt(order, Phase.QUEUED))
                self.queue.append(name)
            case Renew():
                self.ledger.raise_fences(order)
            case Cancel():
                if name in self.queue:
                    self.queue.remove(name)
                    self.end(name, ReportState.CANCELLED)
                elif name == self.running:
                    self.met.add("cancelled while it ran")
                    self.end(name, ReportState.CANCELLED)
                    self.running = None
                else:
                    assert before is None
                    self.ledger.put(
                        Attempt(order, Phase.ENDED, make_report(order, "r", ReportState.CANCELLED))
                    )
            case Refuse(reason):
                assert before is None
                if "forgotten" in reason:
                    self.met.add("refused as forgotten")
            case Repeat() | Ignore():
                pass

    def deliver_again(self, number: int, cancelled: bool, newer: int, next_attempt: int) -> None:
        names = list(self.ledger.attempts)
        if not names:
            return
        name = names[-1 - number % len(names)]
        order = self.ledger.attempts[name].order
        epoch = self.ledger.epoch + newer
        revision = self.ledger.revisions[name.in_plan] + newer
        attempt = order.attempt + next_attempt
        again = replace(order, epoch=epoch, revision=revision, cancelled=cancelled, attempt=attempt)
        self.deliver(numbered(again))

    def deliver_what_ran(self, number: int) -> None:
        """An order of an attempt that was carried out once, by a newer planner and revision."""
        if not self.started:
            return
        name = self.started[-1 - number % len(self.started)]
        if name not in self.ledger.attempts:
            self.met.add("ordered after it was forgotten")
        order = Order(
            robot="hsr",
            planner=name.planner,
            plan=name.plan,
            task=name.task,
            revision=self.ledger.revisions.get(name.in_plan, 0) + 1,
            attempt=name.attempt,
            epoch=self.ledger.epoch + 1,
            skill="navigate",
            args={"robot": "hsr", "to": "kitchen"},
            deadline_s=60.0,
        )
        self.deliver(numbered(order))
        assert self.queue.count(name) == 0

    def forget(self) -> None:
        """Forget the oldest attempt that has ended."""
        for attempt in self.ledger.in_phase(Phase.ENDED):
            self.ledger.forget(attempt.name)
            self.met.add("forgotten with a serial" if attempt.order.serial else "forgotten")
            break

    def go_on(self, state: ReportState = ReportState.FAILED) -> None:
        """End what runs, or else start what is first in the queue."""
        if self.running is not None:
            self.end(self.running, state)
            self.running = None
        elif self.queue:
            self.running = self.queue.pop(0)
            self.ledger.put(Attempt(self.ledger.attempts[self.running].order, Phase.STARTED))
            self.started.append(self.running)

    def withdraw(self) -> None:
        if self.queue:
            self.ledger.drop(self.queue.pop())

    def crash_and_restart(self) -> None:
        kept = Ledger(
            epoch=self.ledger.epoch,
            revisions=dict(self.ledger.revisions),
            forgotten=dict(self.ledger.forgotten),
            unnumbered=dict(self.ledger.unnumbered),
        )
        for attempt in self.ledger.attempts.values():
            if attempt.phase is not Phase.QUEUED:
                kept.put(attempt)
        self.ledger, self.queue, self.running = kept, [], None
        for attempt in kept.in_phase(Phase.STARTED):
            self.met.add("interrupted by a crash")
            self.end(attempt.name, ReportState.INTERRUPTED)

    def check(self) -> None:
        """One attempt never runs twice; attempts of a task start in order; the epoch only rises."""
        assert len(self.started) == len(set(self.started))
        for of_task in {name.of_task for name in self.started}:
            attempts = [name.attempt for name in self.started if name.of_task == of_task]
            assert attempts == sorted(attempts)
        assert self.ledger.epoch >= self.epoch
        self.epoch = self.ledger.epoch


Step = Callable[[Fenced], None]
steps: st.SearchStrategy[Step] = st.one_of(
    st.builds(lambda o: lambda m: m.deliver(o), orders),
    st.builds(
        lambda n, c, up, further: lambda m: m.deliver_again(n, c, up, further),
        st.integers(0, 9),
        st.booleans(),
        st.integers(0, 1),
        st.integers(0, 1),
    ),
    st.builds(lambda n: lambda m: m.deliver_what_ran(n), st.integers(0, 9)),
    st.sampled_from(
        [
            Fenced.go_on,
            Fenced.go_on,
            Fenced.forget,
            Fenced.forget,
            Fenced.withdraw,
            Fenced.crash_and_restart,
        ]
    ),
)


@reaches(
    *(kind.__name__ for kind in (Accept, Renew, Cancel, Repeat, Refuse, Ignore)),
    "superseded in the queue",
    "cancelled while it ran",
    "interrupted by a crash",
    "forgotten",
    "forgotten with a serial",
    "ordered after it was forgotten",
    "refused as forgotten",
)
@settings(max_examples=300, deadline=None)
@given(st.lists(steps, min_size=15, max_size=50))
def test_one_attempt_never_runs_twice_whatever_comes(reached: Reached, taken: list[Step]) -> None:
    fenced = Fenced()
    for step in taken:
        step(fenced)
        fenced.check()
    reached.update(fenced.met)


@reaches("queue", "start", "end", "dropped", "forgotten")
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.lists(
        st.tuples(
            st.builds(
                lambda order, numbers: numbered(
                    replace(order, task="t1", plan="p", planner="numbering" if numbers else None)
                ),
                orders,
                st.booleans(),
            ),
            st.sampled_from(["queue", "start", "end", "open", "forget"]),
        ),
        min_size=8,
        max_size=14,
    )
)
def test_the_journal_on_disk_is_the_ledger_in_memory(
    reached: Reached, steps: list[tuple[Order, str]]
) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "hsr.journal"
        ledger = Ledger()
        keep = Retention(count=1)
        journal = Journal(path, keep, lambda: 5.0).__enter__()
        try:
            for order, step in steps:
                name = AttemptName.of(order)
                if step == "queue" and name not in ledger.attempts:
                    reached[step] += 1
                    journal.queued(order)
                    ledger.put(Attempt(order, Phase.QUEUED))
                elif step == "start" and name in ledger.attempts:
                    reached[step] += 1
                    journal.started(order, make_report(order, "r", ReportState.STARTED))
                    ledger.put(Attempt(order, Phase.STARTED))
                elif step == "end":
                    reached[step] += 1
                    report = make_report(order, "r", ReportState.SUCCEEDED)
                    journal.ended(order, report)
                    ledger.put(Attempt(order, Phase.ENDED, replace(report, told=True), 5.0))
                elif step == "forget":
                    while (unsent := journal.unsent()) is not None:
                        journal.sent(unsent.number)
                    journal.forget(name.__eq__)
                    for known in set(ledger.attempts) - set(journal.ledger.attempts):
                        reached["forgotten"] += 1
                        assert known != name
                        ledger.forget(known)
                    ended = list(ledger.in_phase(Phase.ENDED))
                    assert len(ledger.attempts) <= 1 or len(ended) <= 1
                elif step == "open":
                    journal.__exit__(None, None, None)
                    journal = Journal(path, keep, lambda: 5.0).__enter__()
                    for attempt in ledger.in_phase(Phase.QUEUED):
                        reached["dropped"] += 1
                        ledger.drop(attempt.name)
                assert journal.ledger.epoch == ledger.epoch
                assert journal.ledger.revisions == ledger.revisions
                assert journal.ledger.attempts == ledger.attempts
                assert journal.ledger.forgotten == ledger.forgotten
                assert journal.ledger.unnumbered == ledger.unnumbered
        finally:
            journal.__exit__(None, None, None)
