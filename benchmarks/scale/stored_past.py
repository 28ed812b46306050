"""A store as it looks after long service: reports of plans that are over, put there directly."""

from __future__ import annotations

from pathlib import Path

from benchmarks.scale.errands import DURATION_S
from benchmarks.scale.processes import REALM
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.keyspace import REPORT
from keyexpr_schema.payloads.tasks import Report, ReportAddress, ReportState
from keyexpr_schema.transport.samples import encoding_of
from keyexpr_schema.transport.store.storage import Write

TASKS_A_PLAN = 16
ROBOTS = 50
_BATCH = 5000


def store_reports(data_dir: Path, count: int) -> None:
    """So many final reports, of plans of 16 tasks by 50 robots."""
    encoding = encoding_of(REPORT)
    with SqliteStore(data_dir) as store:
        for first in range(0, count, _BATCH):
            store.apply(
                [
                    Write(
                        f"{REALM}/{REPORT.build(ReportAddress.of(report))}",
                        (number + 1) << 128,
                        False,
                        encoding,
                        REPORT.encode(report),
                    )
                    for number in range(first, min(first + _BATCH, count))
                    for report in (_report(number),)
                ]
            )


def _report(number: int) -> Report:
    began_s = float(number)
    return Report(
        robot=f"r{number % ROBOTS}",
        plan=f"past-{number // TASKS_A_PLAN}",
        revision=1,
        task=f"t{number % TASKS_A_PLAN + 1}",
        attempt=1,
        epoch=1,
        incarnation="i1",
        state=ReportState.SUCCEEDED,
        started_s=began_s,
        ended_s=began_s + DURATION_S,
    )
