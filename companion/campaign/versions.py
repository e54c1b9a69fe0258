"""Which code is being flown: the commit, and a fingerprint of every file that can change a flight."""

from __future__ import annotations

import hashlib
import importlib.metadata
import platform
import subprocess
from dataclasses import dataclass
from pathlib import Path

import companion
from companion.errors import InputError

_CODE = (
    ("companion", ("*.py",)),
    ("sitl_stub", ("*.py", "*.yaml", "*.json")),
    ("config", ("*.yaml",)),
    ("missions", ("*.yaml",)),
)
_NOT_FLOWN = (
    "config/campaigns/",
    "config/papers/",
    "companion/cli/",
    "companion/papers/",
    "companion/report/",
)  # cannot change a flight
_PACKAGES = ("numpy", "scipy", "opencv-python-headless", "apriltag-python", "osqp", "piqp", "pymavlink", "mcap")


@dataclass(frozen=True, slots=True, kw_only=True)
class Commit:
    """Where the checkout stands."""

    hash: str  # full
    changed: bool  # files that are not as in the commit, or not in it


def project_root() -> Path:
    """Give the directory that holds the packages."""
    return Path(companion.__file__).resolve().parents[1]


def current_commit(root: Path) -> Commit:
    """Ask git.

    Raises:
        InputError: there is no git, no checkout, or no commit.
    """
    return Commit(
        hash=_git(root, "rev-parse", "HEAD").strip(), changed=bool(_git(root, "status", "--porcelain").strip())
    )


def fingerprint(root: Path) -> str:
    """Hash the code, the data and the versions that decide how a flight goes: 16 hexadecimal digits."""
    digest = hashlib.sha256(platform.python_version().encode())
    for package in _PACKAGES:
        digest.update(f"{package} {_version(package)}\n".encode())
    for folder, patterns in _CODE:
        for path in sorted(p for pattern in patterns for p in (root / folder).rglob(pattern)):
            name = path.relative_to(root).as_posix()
            if not name.startswith(_NOT_FLOWN):
                digest.update(f"{name}\n".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "none"


def _git(root: Path, *arguments: str) -> str:
    try:
        done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True, timeout=30.0)
    except (OSError, subprocess.SubprocessError):
        raise InputError.single(
            source="--seeds auto",
            wrong=f"{root} is not a git checkout with a commit, so there is no hash to draw seeds from",
            right="give seeds, for example --seeds 1..30",
        ) from None
    return done.stdout
