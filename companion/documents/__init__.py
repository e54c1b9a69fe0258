"""YAML documents with the place of every value: all errors at once, with file, line and column."""

from companion.documents.defaults import to_plain
from companion.documents.expectation import Example
from companion.documents.files import read_text
from companion.documents.nearest import nearest
from companion.documents.nodes import Document, dotted, plain
from companion.documents.override import apply_override, apply_overrides, split_override
from companion.documents.parse import load_document, parse_document
from companion.documents.schema import json_schema
from companion.documents.validate import in_order, load_validated, validate

__all__ = [
    "Document",
    "Example",
    "apply_override",
    "apply_overrides",
    "dotted",
    "in_order",
    "json_schema",
    "load_document",
    "load_validated",
    "nearest",
    "parse_document",
    "plain",
    "read_text",
    "split_override",
    "to_plain",
    "validate",
]
