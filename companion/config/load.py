"""Read, dump and fingerprint a configuration."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Iterable
from typing import Any

import yaml

from companion.config.docking_tree import DockingConfig
from companion.config.tree import Config
from companion.documents import Document, apply_overrides, json_schema, load_document, to_plain, validate
from companion.documents.nodes import MappingNode
from companion.errors import InputError
from companion.mission.load import resolved


def load_config(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> Config:
    """Read and check a configuration.

    Args:
        path: the file.
        overrides: texts `a.b=value`, as from `--set`; paths in them count from the current directory.

    Raises:
        InputError: with every problem of the file.
    """
    return read_config(path, overrides)[0]


def read_config(path: str | os.PathLike[str], overrides: Iterable[str] = ()) -> tuple[Config, Document]:
    """Read and check a configuration; give the document too, for the places of further problems. See `load_config`."""
    document = load_document(path)
    if is_spacecraft(document):
        raise InputError.single(
            source=document.source,
            wrong="this is the configuration of a docking spacecraft, which has no autopilot",
            right="name a vehicle's, such as config/x500_sim.yaml, or give this one to a mission whose step is dock",
        )
    document = apply_overrides(document, overrides)
    config = validate(document, Config)
    calibration = resolved(document, ("camera", "calibration"), config.camera.calibration)
    config = dataclasses.replace(config, camera=dataclasses.replace(config.camera, calibration=calibration))
    if config.ranging.survey is not None:
        survey = resolved(document, ("ranging", "survey"), config.ranging.survey)
        config = dataclasses.replace(config, ranging=dataclasses.replace(config.ranging, survey=survey))
    key_file = config.link.signing.key_file
    if key_file is not None:
        key_file = resolved(document, ("link", "signing", "key_file"), key_file)
        signing = dataclasses.replace(config.link.signing, key_file=key_file)
        config = dataclasses.replace(config, link=dataclasses.replace(config.link, signing=signing))
    return config, document


def is_spacecraft(document: Document) -> bool:
    """Say whether an opened file configures a docking spacecraft: it has the key `spacecraft`."""
    return isinstance(document.root, MappingNode) and "spacecraft" in document.root.entries


def dump(config: Config | DockingConfig) -> str:
    """Write the effective configuration, every default included, as YAML; the first line holds its fingerprint."""
    body: str = yaml.safe_dump(
        to_plain(config), sort_keys=False, default_flow_style=None, width=110, allow_unicode=True
    )
    return f"# effective configuration, sha256 {fingerprint(config)}\n{body}"


def fingerprint(config: Config | DockingConfig) -> str:
    """Give the SHA-256 of the effective configuration: equal for equal values, however they were written."""
    canonical = json.dumps(to_plain(config), sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(canonical.encode("ascii")).hexdigest()


def config_schema() -> dict[str, Any]:
    """Build the JSON Schema of configuration files."""
    return json_schema(Config, title="Configuration")


def docking_config_schema() -> dict[str, Any]:
    """Build the JSON Schema of the configuration of a docking spacecraft."""
    return json_schema(DockingConfig, title="Configuration of a docking spacecraft")
