"""Task files: what they say, and one sentence on what is wrong in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from fleet.errors import BadTaskFile
from fleet.language.methods.model import Method
from fleet.language.methods.patterns import BadPhrase, Slot, rows_of
from fleet.language.methods.task_file import tasks_from_data
from fleet.service.task_files import load_all_tasks, load_tasks
from keyexpr_schema.config_files import config_file

ROOT = Path(__file__).parents[3]


def phrases(text: str) -> set[str]:
    return {
        " ".join(part if isinstance(part, str) else f"<{part.name}>" for part in row)
        for row in rows_of(text)
    }


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("make coffee", {"make coffee"}),
        ("set|lay the table", {"set table", "lay table"}),
        ("wash up [now]", {"wash up", "wash up now"}),
        ("put out (towels|a towel)", {"put out towels", "put out towel"}),
        ("air [the flat|every room]", {"air", "air flat", "air every room"}),
        ("serve [for {n: number} [people]]", {"serve", "serve for <n>", "serve for <n> people"}),
        ("Get {who: person} a drink", {"get <who> drink"}),
        ("serve two", {"serve 2"}),
    ],
)
def test_a_phrase_stands_for_rows_of_words(text: str, rows: set[str]) -> None:
    assert phrases(text) == rows


def test_a_parameter_has_a_type() -> None:
    assert rows_of("water {plant: plant & dry}") == (("water", Slot("plant", "plant & dry")),)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("set [the table", "'[' that is never closed"),
        ("set (the table]", "'(' that is never closed"),
        ("set the table]", "']' that closes nothing"),
        ("set|", "nothing on one side"),
        ("| set", "nothing on one side"),
        ("[please]", "must begin with a word"),
        ("{n: number} plates", "must begin with a word"),
        ("serve {a: place} {b: place}", "no word between"),
        ("serve {a b}", "names no parameter"),
        ("a|b c|d e|f g|h i|j k|l m|n", "more than 64"),
    ],
)
def test_a_phrase_that_cannot_be_read(text: str, words: str) -> None:
    with pytest.raises(BadPhrase) as wrong:
        rows_of(text)
    assert words in str(wrong.value)


def task(**fields: Any) -> dict[str, Any]:
    return {"tasks": {"tea": {"says": "make tea", "do": "switch on the kettle"} | fields}}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ([], "there must be a mapping `tasks:`"),
        ({"task": {}}, "there must be a mapping `tasks:`"),
        ({"tasks": {}, "skills": {}}, "has no field 'skills'"),
        ({"tasks": {"make tea": {}}}, "task make tea: its name must be one word"),
        ({"tasks": {"tea": "kettle"}}, "task tea must be a mapping with about, says"),
        ({"tasks": {"tea": {"do": "x"}}}, "task tea: `says` must be a list of texts"),
        ({"tasks": {"tea": {"says": "make tea"}}}, "task tea must say what it means"),
        (task(in_order=["x"]), "`do` (side by side) or `in_order`"),
        (task(say="x"), "task tea has no field 'say'; its fields are about, says"),
        (task(says=["make tea", 3]), "`says` must be a list of texts"),
        (task(says="make [tea"), "task tea: `says`: 'make [tea' has a '[' that is never closed"),
        (task(says="make {n} tea"), "must say what {n} is"),
        (task(says=["make {n: number} teas", "brew {n: place}"]), "{n} is a number and a place"),
        (task(do="fill {n} cups"), "names {n}, which no phrase has; those are none"),
        (task(do="fill {1} cups"), "names {1}, which no phrase has"),
        (task(do="fill {a b} cups"), "has a brace that stands for no parameter"),
        (
            task(says="make tea [for {n: number}]", do="fill {n} cups"),
            "names {n}, which a phrase can leave out: say it in `defaults`",
        ),
        (task(says="make {n: number} teas"), "says nothing of {n}, which its phrases name"),
        (task(defaults={"n": 2}), "`defaults` names 'n', which no phrase has"),
        (
            task(says="make {n: number} teas", do="fill {n} cups", defaults={"n": "many"}),
            "n must be a number from 1 up, not 'many'",
        ),
        (task(defaults=2), "`defaults` must be a mapping"),
        (task(needs="a kettle!"), "`needs`: 'a kettle!' must look like"),
        (task(methods=[{}]), "`do` stands inside of `methods`"),
        ({"tasks": {"tea": {"says": "x", "methods": []}}}, "`methods` must be a list"),
        ({"tasks": {"tea": {"says": "x", "methods": [{}]}}}, "method 1 must say what it means"),
        ({"tasks": {"tea": {"says": "x", "methods": ["y"]}}}, "method 1 must be a mapping"),
        ({"tasks": {"tea": {"says": "x", "in_order": "y"}}}, "`in_order` must be a list"),
        ({"tasks": {"tea": {"says": "x", "in_order": [[]]}}}, "`in_order` must be a list of texts"),
    ],
)
def test_what_is_wrong_in_a_file_is_one_sentence_with_file_and_key(data: Any, words: str) -> None:
    with pytest.raises(BadTaskFile) as wrong:
        tasks_from_data(data, "mine.yaml")
    said = str(wrong.value)
    assert said.startswith("mine.yaml")
    assert words in said
    assert "\n" not in said


def test_a_method_says_its_sentences_side_by_side_or_in_order() -> None:
    method = Method(do=(("put {n} cups on the table", "Open the fridge."), ("close it",)))
    assert method.text({"n": "2"}) == ("put 2 cups on the table. Open the fridge. Then close it.")


def test_at_least_twenty_tasks_are_shipped() -> None:
    shipped = load_all_tasks()
    assert len(shipped) >= 20
    assert all(each.about.endswith(".") for each in shipped)


def test_the_example_of_ones_own_has_five_lines_and_stands_in_the_docs() -> None:
    path = ROOT / "examples" / "own_tasks.yaml"
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) == 5
    assert text in (ROOT / "docs" / "tasks.md").read_text(encoding="utf-8")
    assert [each.name for each in load_tasks(path)] == ["welcome_home"]


def written(path: Path, **tasks: Any) -> Path:
    path.write_text(yaml.safe_dump({"tasks": tasks}), encoding="utf-8")
    return path


def test_ones_own_tasks_go_first_and_say_shipped_ones_anew(tmp_path: Path) -> None:
    own = written(tmp_path / "own.yaml", make_coffee={"says": "make coffee", "do": "find a cup"})
    first, *rest = load_all_tasks((own,))
    assert first.name == "make_coffee"
    assert first.file == str(own)
    assert "make_coffee" not in {each.name for each in rest}
    assert {each.file for each in rest} == {str(config_file("tasks", "household"))}


def test_two_files_of_ones_own_must_not_say_the_same(tmp_path: Path) -> None:
    one = written(tmp_path / "one.yaml", tea={"says": "make tea", "do": "find a cup"})
    same = written(tmp_path / "same.yaml", tea={"says": "brew tea", "do": "find a cup"})
    phrase = written(tmp_path / "phrase.yaml", brew={"says": "make the tea", "do": "find a cup"})
    with pytest.raises(BadTaskFile, match=r"same.yaml: task tea is in .*one.yaml already"):
        load_all_tasks((one, same))
    with pytest.raises(BadTaskFile, match="task brew: 'make tea' calls tea already"):
        load_all_tasks((one, phrase))


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadTaskFile, match=r"none.yaml cannot be read: No such file"):
        load_all_tasks((tmp_path / "none.yaml",))
    broken = tmp_path / "broken.yaml"
    broken.write_text("tasks: [", encoding="utf-8")
    with pytest.raises(BadTaskFile, match=r"broken.yaml is not YAML: line 2"):
        load_all_tasks((broken,))
