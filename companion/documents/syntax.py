"""YAML syntax errors in plain words."""

from __future__ import annotations

from typing import Any

from companion.errors import Problem

# (part of libyaml's message, what was wrong, what would be right); the first that matches is taken.
_EXPLANATIONS = (
    ("found unexpected ':'", "a `:` without a space after it", "write `key: value`, with a space after the colon"),
    (
        "mapping values are not allowed",
        "a `:` where none can stand",
        "indent keys of one level alike, and quote text that contains `: `",
    ),
    ("could not find expected ':'", "a line without `key: value`", "write `key: value`, with a space after the colon"),
    ("did not find expected ',' or ']'", "a list in [ ] is not closed or lacks a comma", "write [a, b, c]"),
    ("did not find expected ',' or '}'", "a mapping in { } is not closed or lacks a comma", "write {a: 1, b: 2}"),
    (
        "did not find expected '-' indicator",
        "the indentation of the list changes here",
        "begin each item with `- ` in the same column",
    ),
    (
        "did not find expected key",
        "the indentation changes here, or a bracket or quote is too much",
        "put the keys of one level into the same column",
    ),
    ("did not find expected node content", "a value is missing here", "write a value, or remove the comma or bracket"),
    (
        "did not find expected <document start>",
        "text after the end of the document",
        "indent the lines of one level alike",
    ),
    ("unexpected end of stream", "a quote is opened and never closed", "close it with the same quote"),
    ("unexpected document indicator", "a quote is opened and never closed", "close it with the same quote"),
    ("unknown escape character", "an unknown \\ sequence between double quotes", "use single quotes, or write \\\\"),
    ("control characters are not allowed", "a control character", "save the file as plain UTF-8 text"),
    ("block sequence entries are not allowed", "a `- ` where no list can stand", "begin the list on a new line"),
    ("undefined tag handle", "an unknown tag (!)", "remove it; write plain values"),
    ("that cannot start any token", "a character that no value can begin with", "put the text into quotes"),
)


def explain_syntax_error(error: Any, *, text: str, source: str) -> Problem:
    """Turn libyaml's error into a problem with line, column and advice."""
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    message = str(getattr(error, "problem", None) or getattr(error, "reason", None) or error)
    line = None if mark is None else mark.line + 1
    column = None if mark is None else mark.column + 1
    wrong, right = f"this is not valid YAML ({message})", "check brackets, quotes and indentation"
    lines = text.splitlines()
    if line is not None and line <= len(lines) and "\t" in _indentation(lines[line - 1]):
        column = lines[line - 1].index("\t") + 1
        wrong, right = "the line is indented with a tab", "indent with spaces"
    else:
        for part, explanation, advice in _EXPLANATIONS:
            if part in message:
                wrong, right = explanation, advice
                if "closed" in explanation and getattr(error, "context_mark", None) is not None:
                    line, column = error.context_mark.line + 1, error.context_mark.column + 1  # where it was opened
                break
    return Problem(source=source, line=line, column=column, key="", wrong=wrong, right=right)


def _indentation(line: str) -> str:
    return line[: len(line) - len(line.lstrip())]
