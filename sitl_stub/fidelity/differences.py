"""The reasoned differences between stub and PX4: rows that may fail, each with its reason."""

from pathlib import Path

import yaml

FILE = Path(__file__).parent / "differences.yaml"
MOST = 5
"""More than so many differences are not reasoned, they are a stub that is not PX4."""


def reasoned_differences(path: Path = FILE) -> dict[str, str]:
    """Read row names and their reasons. Raises `ValueError` when there are more than `MOST` or one has no reason."""
    document = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    reasons = {str(name): str(reason).strip() for name, reason in document.items()}
    if len(reasons) > MOST:
        raise ValueError(f"{path}: {len(reasons)} differences; at most {MOST} are allowed")
    if not all(reasons.values()):
        raise ValueError(f"{path}: each difference needs its reason")
    return reasons
