"""The one reader of YAML files: by YAML 1.2, bounded, and with a sentence for what is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import msgspec
import pytest

from keyexpr_schema import yaml_reader
from keyexpr_schema.typed_yaml import read_typed, typed
from keyexpr_schema.yaml_reader import parsed_yaml, read_yaml, written_yaml, yaml_of_text


class BadYaml(Exception):
    """What the tests have raised."""


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("045", 45),
        ("1:15", "1:15"),
        ("15e-2", 0.15),
        ("+.5E1", 5.0),
        ("1_000", "1_000"),
        ("0x1F", 31),
        ("2026-02-30", "2026-02-30"),
        ("[on, off, yes, No, y]", ["on", "off", "yes", "No", "y"]),
        ("[true, False, ~, null]", [True, False, None, None]),
        ("'101'", "101"),
        ("!!str 101", "101"),
        ("!!float 3", 3.0),
        ("{101: a, true: b, on: c, ~: d}", {"101": "a", "true": "b", "on": "c", "~": "d"}),
        ("&a [1, 2]\n  ", [1, 2]),
        ("{x: &m {a: 1, b: 2}, y: {<<: *m, b: 3}}", {"x": {"a": 1, "b": 2}, "y": {"b": 3, "a": 1}}),
        ("[&one 1, *one]", [1, 1]),
        ('{"a": [1, 2.5, null, true]}', {"a": [1, 2.5, None, True]}),
    ],
)
def test_values_are_as_a_person_means_them(written: str, meant: Any) -> None:
    found = parsed_yaml(written, BadYaml, "here")
    assert found == meant
    assert repr(found) == repr(meant)


BOMB = "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 10)}]\n" for n in range(1, 9)
)


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (
            "tasks:\n  tea: {do: one}\n  tea: {do: two}\n",
            "f.yaml line 3: tasks: 'tea' comes twice",
        ),
        ("a: 1\n'a': 2", "line 2: 'a' comes twice"),
        ("a: 1\nb: [2, .nan]", "line 2: b[1]: .nan is no number that can be meant"),
        ("a: -.INF", "line 1: a: -.INF is no number"),
        ("a: 1e999", "1e999 is larger than any number that can be meant"),
        ("a: 99999999999999999999", "is larger than any number"),
        (f"a: {'9' * 5000}", "a number of 5000 characters"),
        (f"a: 0x{'f' * 5000}", "a number of 5002 characters"),
        ("[" * 100_000, "line 1: it is nested more than 64 deep"),
        (BOMB, "line 6: a5[7]: it has more than 1000000 values, aliases written out"),
        ("a: &x [*x]", "a[0]: nothing before is called &x"),
        ("? [a]\n: 1", "a name must be one word or text"),
        ('a:\n  label: "\\e[2Jhi"', "line 2: a.label: the text has the control character \\x1b"),
        ("a: !!python/object/apply:os.system [x]", "has no meaning here"),
        ("a: !!int three", "'three' is not a int"),
        ("a: 1\n---\nb: 2", "line 2: a second document begins here"),
        ("a: 1\nb: {<<: 3}", "`<<` takes in a mapping"),
        ("world: home\nplaces: [\n", "f.yaml is not YAML: line 3, column 1: "),
        ("a:\x1b", "f.yaml is not YAML: control characters are not allowed"),
    ],
)
def test_what_cannot_be_meant_is_refused_in_a_sentence(written: str, said: str) -> None:
    with pytest.raises(BadYaml) as refused:
        parsed_yaml(written, BadYaml, "f.yaml")
    assert said in str(refused.value)
    assert str(refused.value).startswith("f.yaml ")
    assert len(str(refused.value)) < 200 and str(refused.value).isprintable()


def test_a_file_that_cannot_be_read_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def said(path: Path) -> str:
        with pytest.raises(BadYaml) as refused:
            read_yaml(path, BadYaml)
        return str(refused.value)

    assert "none.yaml cannot be read: No such file" in said(tmp_path / "none.yaml")
    assert said(tmp_path).endswith("cannot be read: it is a folder, and a file is meant")
    latin = tmp_path / "latin.yaml"
    latin.write_bytes("a: 1\nb: caf\xe9\n".encode("latin-1"))
    assert said(latin).endswith("it is not UTF-8 text (line 2); save it as UTF-8")
    monkeypatch.setattr(yaml_reader, "LARGEST_BYTES", 10)
    latin.write_bytes(b"a: 12345678\n")
    assert "it has more than" in said(latin)
    latin.write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert read_yaml(latin, BadYaml) == {"a": 1}


@pytest.mark.parametrize("text", ["15e-2", "045", "1:15", "true", "", "on", "a: b", ".nan"])
def test_what_is_written_is_read_again(text: str) -> None:
    assert parsed_yaml(written_yaml({"text": [text, 0.15, None]}), BadYaml, "here") == {
        "text": [text, 0.15, None]
    }


class Part(msgspec.Struct):
    size_m: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)] = 1.0
    label: str = ""


class Whole(msgspec.Struct):
    parts: dict[Annotated[str, msgspec.Meta(pattern="^[a-z.]+$")], Part] = {}
    rows: dict[str, dict[str, list[int]]] = {}
    listed: tuple[Part, ...] = ()
    on: bool = False


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (
            "rows: {a: {b: [1]}, c: {d: [1],\n e: [1, 1:15]}}",
            "line 2: rows.c.e[1]: expected a whole number, got text '1:15'",
        ),
        ("parts: {a.b: {size_m: w}}", "line 1: parts.a.b.size_m: expected a number, got text 'w'"),
        ("parts: {B: {}}", "line 1: parts.B: expected text matching"),
        (
            "parts: {a: {}, b: {label: 1}}\non: 3\nrows: {a: 1}",
            "line 1: parts.b.label: expected te",
        ),
        (
            "parts:\n  a: {size_m: 920}",
            "line 2: parts.a.size_m: expected a number of at most 100.0, got 920; lengths are in "
            "metres; is this in centimetres?",
        ),
        ("parts: {a: {size_m: 0}}", "expected a number greater than 0.0, got 0"),
        (
            "parts: {a: {label: 101}}",
            "parts.a.label: expected text, got a whole number; put it in quotes: '101'",
        ),
        (
            "listed: [{}, {\n  labl: x}]",
            "line 2: listed[1].labl: there is no such field; valid are: size_m, label",
        ),
        ("on: yes", "on: expected true or false, got text 'yes'"),
        ("off: 1", "line 1: off: there is no such field; valid are: parts, rows, listed, on"),
        ("[1]", "f.yaml: a test file is a list of `name: value` lines, and this is none"),
    ],
)
def test_what_is_not_of_its_type_is_told_with_line_and_place(written: str, said: str) -> None:
    with pytest.raises(BadYaml) as refused:
        typed(yaml_of_text(written, BadYaml, "f.yaml"), Whole, "test file", BadYaml)
    assert said in str(refused.value)


def test_a_place_that_is_lacking_is_told_by_the_line_around_it(tmp_path: Path) -> None:
    path = tmp_path / "f.yaml"
    path.write_text("on: true\nparts:\n  a:\n    label: x\n")
    read, file = read_typed(path, Whole, "test file", BadYaml)
    assert read == Whole(on=True, parts={"a": Part(label="x")})
    assert file.at("parts.a.label") == f"{path} line 4: parts.a.label"
    assert file.at("parts.a.size_m") == f"{path} line 3: parts.a.size_m"
    assert file.at("listed[3].label") == f"{path}: listed[3].label"
