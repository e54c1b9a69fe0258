"""What a misspelt word was probably meant to be."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Give the known word that `word` is probably meant to be, None where none is near."""
    names = list(known)
    folded = {name.lower().replace("-", "_"): name for name in names}
    hits = difflib.get_close_matches(word.lower().replace("-", "_"), list(folded), n=1, cutoff=0.7)
    if hits:
        return folded[hits[0]]
    starts = [name for name in names if name.startswith(f"{word.lower()}_")]  # the unit was left out
    return starts[0] if len(starts) == 1 else None
