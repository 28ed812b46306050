"""`robotctl tasks`: what goals can call by a name of its own."""

from __future__ import annotations

from cli.command import Call, single


@single
async def tasks(call: Call) -> None:
    """Tasks that goals can name ("set the table for two"), with the phrases that call them.

    `robotctl task explain TEXT` says what one would mean here. More of them come from files:
    `robotctl planner --tasks FILE`.
    """
    from cli.client.planner_requests import ask_about_tasks
    from cli.views.named_tasks import named_tasks_table
    from keyexpr_schema.payloads.methods import TasksQuery

    async with call.session() as session:
        reply = await ask_about_tasks(session, TasksQuery())
    known = reply.tasks
    call.show(known, lambda: named_tasks_table(known) if known else "No tasks are known.")
