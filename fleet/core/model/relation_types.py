"""Relations that a skill file declares: what they are said of, and which values they have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from fleet.core.model.formulas.evaluation import is_number
from fleet.core.model.formulas.nodes import (
    ConditionalEffect,
    Formula,
    Holds,
    atoms,
)
from fleet.core.model.parameter_types import BadType, narrowed, parse_type
from fleet.errors import BadSkillFile
from fleet.language.vocabulary import StateWord
from keyexpr_schema.facts import Literal, Value, parse_value, render_value

BOOL, NUMBER = "bool", "number"


class RelationType(NamedTuple):
    """What a relation is said of, a type, and its values: `bool`, `number`, a type, or words."""

    of: str
    values: str | tuple[str, ...]


def relation_types(data: Any, where: str) -> dict[str, RelationType]:
    """The declarations in the parsed YAML under `relations:`.

    Raises:
        BadSkillFile: one sentence that names the relation, and says what would be right.
    """
    if not isinstance(data, dict):
        raise BadSkillFile(f"{where}: `relations` must map relations to what they are said of")
    return {
        str(name): _relation_type(row, f"{where}: relation {name}") for name, row in data.items()
    }


def _relation_type(row: Any, where: str) -> RelationType:
    if not isinstance(row, dict) or set(row) - {"says"} != {"of", "values"}:
        raise BadSkillFile(
            f"{where} must have `of`, a type, and `values`: bool, number, a type or a list of words"
        )
    values = row["values"]
    try:
        of = str(parse_type(str(row["of"])))
        if isinstance(values, list) and values and all(isinstance(word, str) for word in values):
            return RelationType(of, tuple(values))
        if values in (BOOL, NUMBER):
            return RelationType(of, str(values))
        if isinstance(values, str):
            return RelationType(of, str(parse_type(values)))
    except BadType as wrong:
        raise BadSkillFile(f"{where}: {wrong}") from None
    raise BadSkillFile(f"{where}: `values` must be bool, number, a type or a list of words")


def state_words(
    data: Mapping[str, Any], relations: Mapping[str, RelationType], where: str
) -> tuple[StateWord, ...]:
    """The words that the declarations give for values: `says: {true: [clean], false: [dirty]}`.

    Raises:
        BadSkillFile: one sentence that names the relation, and says what would be right.
    """
    found: list[StateWord] = []
    for name, row in data.items():
        says, declared = row.get("says", {}), relations[str(name)]
        if not isinstance(says, dict) or not all(
            isinstance(words, list) and all(isinstance(word, str) and word for word in words)
            for words in says.values()
        ):
            raise BadSkillFile(
                f"{where}: relation {name}: `says` must map values to lists of words, in quotes "
                "where YAML needs them"
            )
        for written, words in says.items():
            value = parse_value(str(written)) if declared.values in (BOOL, NUMBER) else written
            if not _fits(value, declared.values, {}):
                raise BadSkillFile(f"{where}: relation {name}: {value!r} is none of its values")
            found.extend(
                StateWord(word=word, type=declared.of, relation=str(name), value=value)
                for word in words
            )
    return tuple(found)


def check_literals(
    literals: Iterable[Literal],
    conditions: Iterable[Formula],
    effects: Iterable[ConditionalEffect],
    parameters: Mapping[str, str],
    relations: Mapping[str, RelationType],
    where: str,
) -> None:
    """Hold all that a skill says against the declarations.

    Raises:
        BadSkillFile: one sentence on the first that does not fit.
    """
    effects = tuple(effects)
    said = [
        *literals,
        *(Literal(e.variable, e.value) for e in effects if e.add is None),
        *(a.literal for f in (*conditions, *(e.when for e in effects)) for a in atoms(f)
          if isinstance(a, Holds)),
    ]  # fmt: skip
    for literal in said:
        declared = relations.get(literal.variable.relation)
        if declared is not None and not _fits(literal.value, declared.values, parameters):
            wanted = declared.values
            raise BadSkillFile(
                f"{where}: {str(literal).replace('$', '')!r}: the value of "
                f"{literal.variable.relation} is "
                f"{wanted if isinstance(wanted, str) else 'one of ' + ', '.join(wanted)}, "
                f"not {render_value(literal.value)}"
            )
    for effect in effects:
        declared = relations.get(effect.variable.relation)
        if effect.add is not None and declared is not None and declared.values != NUMBER:
            raise BadSkillFile(
                f"{where}: {effect.variable.relation} is declared as no number, and cannot be "
                "added to"
            )


def _fits(value: Value, wanted: str | tuple[str, ...], parameters: Mapping[str, str]) -> bool:
    if value is None or (isinstance(value, str) and value.startswith("$")):
        return True
    if not isinstance(wanted, str):
        return value in wanted
    if wanted == BOOL:
        return isinstance(value, bool)
    if wanted == NUMBER:
        return is_number(value)
    kind = parameters.get(value) if isinstance(value, str) else None
    return kind is not None and narrowed(parse_type(kind), parse_type(wanted)) is not None


def narrowed_parameters(
    parameters: Mapping[str, str],
    literals: Iterable[Literal],
    relations: Mapping[str, RelationType],
    where: str,
) -> dict[str, str]:
    """The types of parameters, each also of what the relations said of it are declared for.

    Raises:
        BadSkillFile: nothing can be of both types.
    """
    found = dict(parameters)
    for (relation, subject), _ in literals:
        if relation in relations and subject in found:
            both = narrowed(parse_type(found[subject]), parse_type(relations[relation].of))
            if both is None:
                raise BadSkillFile(
                    f"{where}: {relation} is said of {relations[relation].of}, "
                    f"and `{subject}` is of type {parameters[subject]}"
                )
            found[subject] = str(both)
    return found
