"""Reads the suite of sentences: `python -m benchmarks.language.run --help`."""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import msgspec
from rich.console import Console
from rich.table import Table

from benchmarks.language.entries import KINDS, PARTS, Sentence, load_suite
from benchmarks.language.model import MODEL_HEAD, ModelReader, model_rows
from benchmarks.language.reader import Answer, answer
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
from benchmarks.tables import as_markdown
from fleet.errors import BadLlmConfig, FleetError
from fleet.llm import LanguageModel, load_llm_config

MODEL_SAYS = (
    "What the grammar refuses is read as the model says it, and classed as if that were taken at "
    "once; in the fleet, a person confirms it before (`language.confirm`)."
)
MOST_REASONS = 3
PAGE = Path(__file__).parents[2] / "docs" / "benchmarks" / "language.md"


def main() -> int:
    """Read what the command line asks for; 0 if it ran, however the sentences were read."""
    options = _options()
    sentences = load_suite(options.only, options.kind)
    sentences = tuple(s for s in sentences if options.world in (None, s.entry.world))
    if not sentences:
        sys.stderr.write("there is no such sentence\n")
        return 2
    try:
        model = _model(options)
    except FleetError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    for world in world_names():
        answer("Where is it?", world)
    reader = None if model is None else ModelReader(model)
    try:
        if model is not None:
            model.warm()
        how = answer if reader is None else reader.answer
        results = [_result(sentence, how) for sentence in sentences]
    finally:
        if model is not None:
            model.close()
    console = Console(width=None if sys.stdout.isatty() else 160)
    if options.show is not None:
        _show(results, options.show, options.only, reader)
    _print(console, HEAD, rows_of(results))
    _print(console, TARGET_HEAD, target_rows(results))
    if reader is None:
        _print(console, TIME_HEAD, time_rows(results))
    else:
        console.print(MODEL_SAYS)
        _print(console, MODEL_HEAD, model_rows(results, reader.asked))
        reasons = Counter(asked.why for asked in reader.asked.values() if asked.said is None)
        for why, count in reasons.most_common(MOST_REASONS):
            console.print(f"no words, {count} times: {why}", markup=False)
    whole = (options.only, options.kind, options.world, reader) == (None,) * 4
    out = options.out or (PAGE if whole else None)
    if out is not None:
        write_page(out, results, _with_model(reader, results))
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
        "--model",
        help="what the grammar refuses is read as this language model says it (a LiteLLM name)",
    )
    parser.add_argument("--api-base", help="with --model: the URL of an OpenAI-compatible server")
    parser.add_argument(
        "--llm-config",
        type=Path,
        help="with --model: a file such as configs/planner.yaml, for all else about it",
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="the page (default: docs/benchmarks/language.md for the whole suite)",
    )
    return parser.parse_args()


def _model(options: argparse.Namespace) -> LanguageModel | None:
    """The language model that is to be asked.

    Raises:
        FleetError: it cannot be configured so; one sentence.
    """
    if options.model is None:
        return None
    config = load_llm_config(options.llm_config)
    given = {"model": options.model, "api_base": options.api_base or config.api_base}
    try:
        return LanguageModel(msgspec.structs.replace(config, **given))
    except ValueError as wrong:
        raise BadLlmConfig(str(wrong)) from None


def _result(sentence: Sentence, how: Callable[[str, str], Answer]) -> Result:
    entry = sentence.entry
    began_s = time.process_time()
    found = how(entry.say, entry.world)
    took_s = time.process_time() - began_s
    verdict = judge(entry, found, partial(answer, world=entry.world))
    return Result(sentence, found, verdict, took_s)


def _show(
    results: Sequence[Result], which: str, only: str | None, reader: ModelReader | None
) -> None:
    for result in results:
        entry, verdict = result.sentence.entry, result.verdict
        hidden = result.sentence.part != PARTS[0] and only != result.sentence.part
        if hidden or (which not in ("all", verdict.value) and (which != "bad" or result.good)):
            continue
        print(f"{entry.id} [{entry.world}] {entry.say!r}: {verdict.value}")
        asked = None if reader is None else reader.asked.get((entry.world, entry.say))
        if asked is not None and asked.said is not None:
            print(f"    said {asked.said!r}")
        print(f"    got  {result.told}")
        for meaning in entry.meanings():
            print(f"    want {meaning}")
        for meaning in entry.candidates():
            print(f"    ask  {meaning}")
        if entry.refused:
            print(f"    refusal that names {', '.join(entry.refused)}")


def _with_model(reader: ModelReader | None, results: Sequence[Result]) -> str:
    """What the page says of the language model, if one was asked."""
    if reader is None:
        return ""
    config = reader.model.config
    rows = as_markdown(MODEL_HEAD, model_rows(results, reader.asked))
    return f"## With {config.model}\n\n{MODEL_SAYS}\n\n{rows}\n\n"


def _print(console: Console, head: Row, rows: Sequence[Row]) -> None:
    table = Table(*head)
    for row in rows:
        table.add_row(*row)
    console.print(table)


if __name__ == "__main__":
    sys.exit(main())
