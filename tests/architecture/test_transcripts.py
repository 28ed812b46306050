"""Commands of a page are all found, and what they print is held against all that it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.transcripts import Bash, differs, not_typed, typed

PAGE = """
Text with `robotctl status`.

```console
$ one \\
    --more
$ two   # says no, exit code 1
shown … here
…
$ three   # until Ctrl-C
```

```text
$ four
```

    robotctl five
"""


def test_commands_of_blocks_are_found_with_what_is_shown() -> None:
    one, two, three = typed(PAGE)
    assert (one.command, one.code, one.shown) == ("one \\\n    --more", 0, ())
    assert (two.line, two.code, two.shown) == (7, 1, ("shown … here", "…"))
    assert (three.until_ctrl_c, three.code) == (True, 130)


def test_what_looks_like_a_command_and_is_not_typed_is_told() -> None:
    assert not_typed(PAGE) == ["$ four", "    robotctl five"]


@pytest.mark.parametrize(
    ("shown", "printed", "missing"),
    [
        (["a  b"], "a b\n\n", None),
        (["since today 10:00, 3.5 s, 98 %"], "since today 23:59, 12 s, 100 %", None),
        (["hold pause-182fefb4"], "hold pause-0a1b2c3d", None),
        (["2 goals"], "3 goals", "2 goals"),
        (["pause-robot"], "pause-other", "pause-robot"),
        (["a", "…", "c"], "a\nb\nb\nc", None),
        (["a", "…"], "a", None),
        (["a", "c"], "a\nb\nc", "c"),
        (["a"], "a\nb", "nothing where it says 'b'"),
        (["… left out"], " left out", "… left out"),
        (["a+b (c)"], "aab (c)", "a+b (c)"),
    ],
)
def test_all_that_is_shown_is_printed_and_nothing_else(
    shown: list[str], printed: str, missing: str | None
) -> None:
    assert differs(tuple(shown), printed) == missing


def test_one_bash_keeps_what_was_set_and_says_how_each_command_ended(tmp_path: Path) -> None:
    bash = Bash(tmp_path)
    try:
        assert bash.run("export A=1   # a comment") == (0, "\n")
        assert bash.run('echo "$A"; printf "%s" "$PWD"; false') == (1, f"1\n{tmp_path}\n")
        assert bash.run("date +%H") == (0, "10\n\n")
        assert bash.run("cat; exec_nothing 2>/dev/null")[0] == 127
        assert bash.run("echo now > log") == (0, "\n")
        assert bash.run("tail -f log", until_ctrl_c=True) == (130, "now\n\n")
    finally:
        bash.close()
