from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

import pytest
from annotated_types import Gt, Interval, Le, Len, MinLen
from hypothesis import given
from hypothesis import strategies as st

from companion.documents import (
    apply_override,
    apply_overrides,
    json_schema,
    load_validated,
    nearest,
    parse_document,
    to_plain,
    validate,
)
from companion.errors import InputError


class Colour(Enum):
    RED = "red"
    BLUE = "blue"


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    """The inner part."""

    speed_mps: Annotated[float, Gt(0.0), Le(5.0)] = 1.0  # over the ground
    count: int = 3
    # Where it sits,
    # on the vehicle.
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ceiling: Annotated[float, Interval(gt=0.0, lt=9.0)] | None = None

    def __post_init__(self) -> None:
        if self.count == 13:
            raise ValueError("13 brings bad luck")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outer:
    """A document."""

    version: Literal[1]
    name: Annotated[str, Len(1, 20)]
    inner: Inner = field(default_factory=Inner)
    many: Annotated[tuple[Inner, ...], MinLen(0)] = ()
    colour: Colour = Colour.RED
    flag: bool = False
    file: Path = Path("x")


@dataclass(frozen=True, slots=True, kw_only=True)
class Filled:
    """A document with a list that may not be empty."""

    many: Annotated[tuple[Inner, ...], MinLen(1)]


HEAD = "version: 1\nname: n\n"


def read(text: str, *overrides: str) -> Outer:
    return validate(apply_overrides(parse_document(text, source="f.yaml"), overrides), Outer)


def lines_of(text: str, *overrides: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        read(text, *overrides)
    return [str(problem) for problem in caught.value.problems]


def test_values_arrive_with_their_types() -> None:
    outer = read(
        HEAD + "inner: {speed_mps: 2, place: [1, 2.5, 3]}\nmany: [{count: 4}]\ncolour: blue\nflag: true\nfile: a/b\n"
    )
    assert outer == Outer(
        version=1,
        name="n",
        inner=Inner(speed_mps=2.0, place=(1.0, 2.5, 3.0)),
        many=(Inner(count=4),),
        colour=Colour.BLUE,
        flag=True,
        file=Path("a/b"),
    )
    assert isinstance(outer.inner.speed_mps, float)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "inner: {speed_mps: 0}",
            "f.yaml:3:20: inner.speed_mps: found 0; it must be a number greater than 0 and at most 5",
        ),
        ("inner: {speed_mps: .nan}", "found not-a-number; it must be a finite number"),
        ("inner: {speed_mps: -.inf}", "found infinity; it must be a finite number"),
        ('inner: {speed_mps: "2"}', "at most 5, without quotes"),
        ("inner: {speed_mps: true}", "found true; it must be a number"),
        ("inner: {speed_mps: 1_000}", 'found the text "1_000"'),
        ("inner: {speed_mps: }", "inner.speed_mps: found nothing"),
        ("inner: {place: [0, .nan, 0]}", "inner.place.1: found not-a-number; it must be a finite number"),
        ("inner: {place: [0, 0, .inf]}", "inner.place.2: found infinity; it must be a finite number"),
        ("inner: {count: 2.0}", "found 2.0; it must be a whole number, without a decimal point"),
        ("inner: {count: 13}", "f.yaml:3:8: inner: 13 brings bad luck"),
        ("inner: {ceiling: 9}", "found 9; it must be a number greater than 0 and less than 9"),
        ("inner: {place: [1, 2]}", "found a list of 2; it must be a list of 3: each a number"),
        ("inner: {place: [1, 2, 3, 4]}", "found a list of 4; it must be a list of 3: each a number"),
        ("inner: {place: [1, x, 3]}", 'f.yaml:3:20: inner.place.1: found the text "x"; it must be a number'),
        ("inner: 3", "found 3; it must be a mapping with the keys speed_mps, count, place, ceiling"),
        ("inner: [1]", "found a list of 1; it must be a mapping"),
        ("inner: {sped_mps: 3}", "f.yaml:3:9: inner.sped_mps: no such key; did you mean speed_mps?"),
        ("inner: {speed: 3}", "did you mean speed_mps?"),
        ("inner: {zzz: 3}", "no such key; the keys here are speed_mps, count, place, ceiling"),
        ("many: {a: 1}", "found a mapping with the key a; it must be a list"),
        ("many: [{}, 3]", "f.yaml:3:12: many.1: found 3; it must be a mapping"),
        ("colour: green", 'found the text "green"; it must be red or blue'),
        ("flag: 1", "found 1; it must be true or false"),
        ("file: 3", "found 3; it must be the path of a file"),
    ],
)
def test_each_mistake_is_explained(line: str, expected: str) -> None:
    found = lines_of(HEAD + line + "\n")
    assert len(found) == 1, found
    assert expected in found[0]


def test_missing_keys_come_with_an_example() -> None:
    assert lines_of("flag: true\n") == [
        "f.yaml:1:1: version: the key is missing; add, for example, `version: 1`",
        "f.yaml:1:1: name: the key is missing; add, for example, `name: text`",
    ]


def test_a_misspelt_required_key_is_one_problem_not_two() -> None:
    assert lines_of("version: 1\nnmae: x\n") == ["f.yaml:2:1: nmae: no such key; did you mean name?"]


def test_all_problems_at_once_in_the_order_of_the_file() -> None:
    found = lines_of("version: 2\ncolour: pink\nname: ''\nflag: yes\nflag: no\ninner:\n  zzz: 1\n  speed_mps: -1\n")
    assert [line.split(":")[1] for line in found] == ["1", "2", "3", "4", "5", "5", "7", "8"]


@pytest.mark.parametrize(
    ("text", "keys"), [("many: []\n", ["many"]), ("many:\n  - speed_mps: -1\n", ["many.0.speed_mps"])]
)
def test_a_list_of_wrong_items_is_not_called_short(text: str, keys: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        validate(parse_document(text, source="f.yaml"), Filled)
    assert [problem.key for problem in caught.value.problems] == keys


def test_numbers_as_text_need_quotes() -> None:
    (line,) = lines_of("version: 1\nname: 3\n")
    assert "found 3; it must be text" in line
    assert line.endswith("in quotes")


def test_problems_without_end_are_cut_off() -> None:
    found = lines_of(HEAD + "many: [" + "3, " * 1000 + "]\n")
    assert len(found) == 51
    assert "950 more problems; correct those above first" in found[-1]


@pytest.mark.parametrize("text", ["- 1\n", "text\n", "3\n"])
def test_a_document_that_is_no_mapping(text: str) -> None:
    (line,) = lines_of(text)
    assert "the file must hold `key: value` lines" in line


def test_messages_hold_no_words_of_the_library() -> None:
    text = "version: x\nname: [1]\ninner: {speed_mps: a, count: b, place: {c: d}}\n"
    text += "many: [[1]]\ncolour: 3\nflag: x\nextra: 1\n"
    for line in lines_of(text):
        for word in ("Input should", "pydantic", "dataclass", "instance", "keyword", "str", "float", "int ", "Field"):
            assert word not in line, line


def test_override_replaces_and_adds() -> None:
    outer = read(HEAD + "many: [{count: 1}, {count: 2}]\n", "inner.speed_mps=3", "many.1.count=7", "colour=blue")
    assert (outer.inner.speed_mps, outer.many[1].count, outer.many[0].count, outer.colour) == (3.0, 7, 1, Colour.BLUE)
    assert read(HEAD, "inner.place=[1, 2, 3]").inner.place == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        (
            "inner.speed_mps=-1",
            "--set inner.speed_mps=-1: inner.speed_mps: found -1; it must be a number greater than 0",
        ),
        ("inner.sped_mps=1", "did you mean speed_mps?"),
        ("many.1.count=1", "many is a list of 1; name an item by its index, 0 to 0"),
        ("many.x=1", "many is a list of 1"),
        ("name.x=1", "name is a single value"),
        ("name", "this is not `key=value`"),
        ("=3", "this is not `key=value`"),
        ("a..b=3", "this is not `key=value`"),
        ("name=no", "no is ambiguous"),
        ("name=[", "value"),
        ("name=", "found nothing"),
        ("name=# x", "found nothing"),
    ],
)
def test_bad_overrides_are_explained(override: str, expected: str) -> None:
    (line,) = lines_of(HEAD + "many: [{count: 1}]\n", override)
    assert expected in line
    assert line.startswith("--set ")


def test_every_bad_override_is_reported() -> None:
    assert len(lines_of(HEAD, "name", "flag=yes", "inner.count=x")) == 3


def test_an_override_does_not_change_the_document() -> None:
    document = parse_document(HEAD, source="f.yaml")
    apply_override(document, "name=other")
    assert validate(document, Outer).name == "n"


def test_load_validated(tmp_path) -> None:
    path = tmp_path / "f.yaml"
    path.write_text(HEAD)
    assert load_validated(path, Outer, ["flag=true"]).flag


@pytest.mark.parametrize(
    ("word", "meant"), [("Speed-Mps", "speed_mps"), ("cout", "count"), ("speed", "speed_mps"), ("xyz", None)]
)
def test_nearest(word: str, meant: str | None) -> None:
    assert nearest(word, ["speed_mps", "count"]) == meant


def test_schema_has_keys_ranges_defaults_and_comments() -> None:
    schema = json_schema(Outer, title="Outer")
    inner = schema["$defs"]["Inner"]
    assert schema["required"] == ["version", "name"]
    assert schema["additionalProperties"] is False
    assert inner["additionalProperties"] is False
    assert inner["properties"]["speed_mps"] == {
        "default": 1.0,
        "exclusiveMinimum": 0.0,
        "maximum": 5.0,
        "type": "number",
        "description": "over the ground",
    }
    assert inner["properties"]["place"]["description"] == "Where it sits, on the vehicle."


@given(
    st.builds(
        Outer,
        version=st.just(1),
        name=st.text("abc", min_size=1, max_size=5),
        inner=st.builds(
            Inner,
            speed_mps=st.floats(0.1, 5.0),
            count=st.integers(20, 30),
            place=st.tuples(*[st.floats(-1e6, 1e6)] * 3),
            ceiling=st.none() | st.floats(0.1, 8.0),
        ),
        many=st.lists(st.just(Inner()), max_size=2).map(tuple),
        colour=st.sampled_from(Colour),
        flag=st.booleans(),
        file=st.just(Path("a/b")),
    )
)
def test_plain_data_read_back_give_the_same_values(outer: Outer) -> None:
    import json

    text = json.dumps(to_plain(outer))
    assert validate(parse_document(text, source="f"), Outer) == outer
