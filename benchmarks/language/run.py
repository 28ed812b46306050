"""Reads the suite of sentences: `python -m benchmarks.language.run --help`."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks.language.entries import KINDS, PARTS, Sentence, load_suite
from benchmarks.language.reader import answer
from benchmarks.language.report import (
    HEAD,
    TARGET_HEAD,
    TIME_HEAD,
    Result,
    Row,
    rows_of,
    target_rows,
    time_rows,
    write_page,
)
from benchmarks.language.verdict import Verdict, judge
from benchmarks.language.worlds import world_names

PAGE = Path(__file__).parents[2] / "docs" / "benchmarks" / "language.md"


def main() -> int:
    """Read what the command line asks for; 0 if it ran, however the sentences were read."""
    options = _options()
    sentences = load_suite(options.only, options.kind)
    for world in world_names():
        answer("Where is it?", world)
    results = [
        _result(sentence) for sentence in sentences if options.world in (None, sentence.entry.world)
    ]
    if not results:
        sys.stderr.write("there is no such sentence\n")
        return 2
    console = Console(width=None if sys.stdout.isatty() else 160)
    if options.show is not None:
        _show(results, options.show, options.only)
    _print(console, HEAD, rows_of(results))
    _print(console, TARGET_HEAD, target_rows(results))
    _print(console, TIME_HEAD, time_rows(results))
    out = options.out or (
        PAGE if (options.only, options.kind, options.world) == (None,) * 3 else None
    )
    if out is not None:
        write_page(out, results)
        console.print(f"written: {out}")
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.language.run",
        description="Read the suite of sentences, and class what they were taken for.",
    )
    parser.add_argument("--only", choices=PARTS, help="sentences of this part")
    parser.add_argument("--kind", choices=KINDS, help="sentences of this kind")
    parser.add_argument("--world", choices=world_names(), help="sentences said in this world")
    parser.add_argument(
        "--show",
        choices=("bad", "all", *(verdict.value for verdict in Verdict)),
        help="also show sentences of this class; held-out ones only with --only held-out",
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="the page (default: docs/benchmarks/language.md for the whole suite)",
    )
    return parser.parse_args()


def _result(sentence: Sentence) -> Result:
    entry = sentence.entry
    began_s = time.process_time()
    found = answer(entry.say, entry.world)
    took_s = time.process_time() - began_s
    verdict = judge(entry, found, partial(answer, world=entry.world))
    return Result(sentence, found, verdict, took_s)


def _show(results: Sequence[Result], which: str, only: str | None) -> None:
    for result in results:
        entry, verdict = result.sentence.entry, result.verdict
        hidden = result.sentence.part != PARTS[0] and only != result.sentence.part
        if hidden or (which not in ("all", verdict.value) and (which != "bad" or result.good)):
            continue
        print(f"{entry.id} [{entry.world}] {entry.say!r}: {verdict.value}")
        print(f"    got  {result.told}")
        for meaning in entry.meanings():
            print(f"    want {meaning}")
        for meaning in entry.candidates():
            print(f"    ask  {meaning}")
        if entry.refused:
            print(f"    refusal that names {', '.join(entry.refused)}")


def _print(console: Console, head: Row, rows: Sequence[Row]) -> None:
    table = Table(*head)
    for row in rows:
        table.add_row(*row)
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
