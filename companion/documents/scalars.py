"""What an unquoted word in YAML means here: the YAML 1.2 core rules, with the traps of YAML 1.1 refused."""

from __future__ import annotations

import re

from companion.documents.nodes import Scalar

_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_LEADING_ZERO = re.compile(r"[-+]?0[0-9_]+")
_HEXADECIMAL = re.compile(r"0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITY = re.compile(r"[-+]?\.(inf|Inf|INF)")
_CONSTANTS: dict[str, Scalar] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
}
_OLD_BOOLEANS = {"yes", "no", "on", "off"}
_MAX_DIGITS = 300  # beyond the range of a float


class TrapError(ValueError):
    """A word that programs read differently. `wrong` and `right` say it plainly."""

    def __init__(self, wrong: str, right: str) -> None:
        super().__init__(wrong)
        self.wrong = wrong
        self.right = right


def resolve_plain(text: str) -> Scalar:
    """Give the value of an unquoted scalar.

    Raises:
        TrapError: yes, no, on, off and numbers with a leading zero, which YAML 1.1 and 1.2 read differently.
    """
    if text in _CONSTANTS:
        return _CONSTANTS[text]
    if text.lower() in _OLD_BOOLEANS:
        meant = "true" if text.lower() in ("yes", "on") else "false"
        raise TrapError(
            f"{text} is ambiguous in YAML", f'write {meant} if you mean a switch, "{text}" if you mean text'
        )
    if _LEADING_ZERO.fullmatch(text):
        bare = text.lstrip("+-").replace("_", "").lstrip("0") or "0"
        raise TrapError(
            f"{text} begins with a zero, which some programs read as octal",
            f'write {bare} if you mean a number, "{text}" if you mean text',
        )
    if len(text) > _MAX_DIGITS:
        return text
    if _INTEGER.fullmatch(text):
        return int(text)
    if _HEXADECIMAL.fullmatch(text):
        return int(text, 16)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INFINITY.fullmatch(text):
        return float("-inf") if text.startswith("-") else float("inf")
    return text
