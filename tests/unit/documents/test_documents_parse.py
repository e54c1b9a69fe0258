import math
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.documents import Document, load_document, parse_document, plain
from companion.documents.parse import MAX_NODES, MAX_PROBLEMS
from companion.errors import InputError, Problem


def problems_of(text: str) -> list[tuple[int | None, int | None, str]]:
    """Line, column and message of everything wrong with a text."""
    try:
        found = parse_document(text, source="f.yaml").problems
    except InputError as error:
        found = error.problems
    assert all(p.source == "f.yaml" for p in found)
    return [(p.line, p.column, f"{p.key}: {p.wrong}; {p.right}") for p in found]


def test_plain_data_are_those_of_yaml_1_2() -> None:
    text = "a: 1\nb: -2.5e-3\nc: 1e3\nd: true\ne: null\nf:\ng: '1'\n"
    text += "h: [x, {y: z}]\ni: 0x1F\nj: 12:30\nk: 2020-01-01\nl: .inf\n"
    assert plain(parse_document(text, source="f").root) == {
        "a": 1,
        "b": -0.0025,
        "c": 1000.0,
        "d": True,
        "e": None,
        "f": None,
        "g": "1",
        "h": ["x", {"y": "z"}],
        "i": 31,
        "j": "12:30",
        "k": "2020-01-01",
        "l": math.inf,
    }


def test_every_key_and_value_knows_its_place() -> None:
    document = parse_document("a:\n  b: 1\n  list:\n    - {c: 2}\n    - x\n", source="f.yaml")
    for path, line, column in [
        (("a",), 2, 3),
        (("a", "b"), 2, 6),
        (("a", "list", 0, "c"), 4, 11),
        (("a", "list", 1), 5, 7),
    ]:
        position = document.position(path)
        assert (position.line, position.column) == (line, column), path
    key = document.key_position(("a", "list", 0, "c"))
    assert (key.line, key.column) == (4, 8)
    assert document.position(("a", "nothing", "here")) == document.position(("a",))


@pytest.mark.parametrize("word", ["yes", "NO", "On", "off", "no"])
def test_old_booleans_are_refused(word: str) -> None:
    ((line, column, message),) = problems_of(f"a: 1\nflag: {word}\n")
    assert (line, column) == (2, 7)
    assert "write true" in message or "write false" in message
    assert problems_of(f'flag: "{word}"\n') == []


def test_octal_looking_number_is_refused() -> None:
    ((line, _, message),) = problems_of("a: 0123\n")
    assert line == 1
    assert "write 123" in message


def test_duplicate_key_names_both_lines() -> None:
    ((line, column, message),) = problems_of("a: 1\nb:\n  c: 1\n  d: 2\n  c: 3\n")
    assert (line, column) == (5, 3)
    assert "b.c" in message
    assert "line 3" in message


def test_several_problems_are_all_reported() -> None:
    found = problems_of("a: yes\na: 2\n1: x\nb: !!python/object:os.system ls\n")
    assert [line for line, _, _ in found] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("text", "line", "part"),
    [
        ("1: x\n", 1, "a key must be a word"),
        ("null: x\n", 1, "a key must be a word"),
        ("? [a]\n: x\n", 1, "a key must be a word"),
        ("a: 1\n---\nb: 2\n", 2, "second document"),
        ("a:\n\tb: 1\n", 2, "tab"),
        ("a: {b:}\n", 1, "a space after the colon"),
        ("a: b: c\n", 1, "`:`"),
        ("a: [1, 2\nb: 3\n", 1, "not closed"),
        ("a: {b: 1\n", 1, "not closed"),
        ("x: 1\na: 'text\nb: 3\n", 2, "never closed"),
        ("a: @x\n", 1, "quotes"),
        ("a: *nowhere\n", 1, "before it"),
        ("a: &a [*a]\n", 1, "before it"),
        ("a: &x {b: 1}\nc: {<<: *x}\n", 2, "merge"),
        ("a: 1\n b: 2\n", 2, "`:`"),
        ("a: 1\n- b\n", 2, "indentation"),
        ("a: !foo 1\n", 1, "tag"),
        ("", None, "empty"),
        ("# only a comment\n", None, "empty"),
        ("---\n", None, "empty"),
        ("a: \x07\n", None, "control character"),
    ],
)
def test_bad_yaml_is_explained(text: str, line: int | None, part: str) -> None:
    found = problems_of(text)
    assert len(found) == 1, found
    assert found[0][0] == line
    assert part in found[0][2]


def test_aliases_may_be_used_within_the_budget() -> None:
    document = parse_document("a: &x {b: 1}\nc: *x\n", source="f")
    assert document.problems == ()
    assert plain(document.root) == {"a": {"b": 1}, "c": {"b": 1}}


def test_alias_bomb_is_defused() -> None:
    lines = ["l0: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 10)}]" for n in range(1, 30)]
    ((_, _, message),) = problems_of("\n".join(lines))
    assert "aliases" in message


@pytest.mark.parametrize(
    "text", ["[" * 5000, "{a: " * 5000, "? " * 5000, "- " * 5000, "a: [" + "1, " * (MAX_NODES + 1) + "]"]
)
def test_deep_and_long_documents_are_refused(text: str) -> None:
    ((_, _, message),) = problems_of(text)
    assert "nested deeper" in message or "more than" in message


def test_problems_without_end_are_cut_off() -> None:
    found = problems_of("{" + "a, " * 1000 + "}")
    assert len(found) == MAX_PROBLEMS + 1
    assert "correct those above first" in found[-1][2]


def test_wanted_tags_are_ignored() -> None:
    text = "%YAML:1.0\n---\nm: !!opencv-matrix\n  rows: 1\n"
    assert parse_document(text, source="f", tags=["tag:yaml.org,2002:opencv-matrix"]).problems == ()
    assert len(parse_document(text, source="f").problems) == 1


@given(st.text(alphabet=st.sampled_from("ab:-[]{}&*!|>'\"%@`#?, \n\t0.1~<\\"), max_size=60))
@settings(max_examples=400, deadline=None)
def test_any_text_gives_a_document_or_a_plain_error(text: str) -> None:
    problems: tuple[Problem, ...] = ()
    document: Document | None = None
    try:
        document = parse_document(text, source="f.yaml")
    except InputError as error:
        problems = error.problems
    assert document is not None or problems
    assert all(p.wrong and p.right and "Error" not in p.wrong for p in problems)


def refused(path: str | os.PathLike[str]) -> str:
    with pytest.raises(InputError) as caught:
        load_document(path)
    assert len(caught.value.problems) == 1
    return str(caught.value)


def test_a_misspelt_file_is_answered_with_the_one_that_was_probably_meant(tmp_path) -> None:
    (tmp_path / "land_static.yaml").write_text("a: 1\n")
    assert refused(str(tmp_path / "land_statc.yaml")).endswith(f"did you mean {tmp_path / 'land_static.yaml'}?")


def test_files_that_cannot_be_read(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "near.yaml").write_text("a: 1\n")
    (tmp_path / "latin.yaml").write_bytes(b"a: 1\nname: Z\xfcrich\n")
    (tmp_path / "huge.yaml").write_bytes(b"# x\n" * 400_000)
    os.mkfifo(tmp_path / "fifo.yaml")
    assert "missing.yaml: no such file" in refused("missing.yaml")
    assert "near.yaml" in refused("missing.yaml")
    assert "no directory nope" in refused("nope/missing.yaml")
    assert "directory" in refused(tmp_path)
    assert "not a regular file" in refused("fifo.yaml")
    assert "larger than 1 MB" in refused("huge.yaml")
    assert refused("latin.yaml").startswith("latin.yaml:2: byte 0xfc is not valid UTF-8")
    assert "cannot be read" in refused("a\0b")


def test_unreadable_file(tmp_path, monkeypatch) -> None:
    path = tmp_path / "secret.yaml"
    path.write_text("a: 1\n")

    def refuse(*args, **kwargs):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refuse)
    assert "may not be read" in refused(path)


def test_byte_order_mark_is_accepted(tmp_path) -> None:
    path = tmp_path / "bom.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\n")
    assert plain(load_document(path).root) == {"a": 1}
