"""Which seeds a campaign flies: given ones, or ones that nobody could tune on, drawn from the commit's hash."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass

from companion.errors import InputError

MAX_SEED = 2**31
MAX_COUNT = 10_000
_AUTO = re.compile(r"auto(?::(\d+))?")
_RANGE = re.compile(r"(\d+)\.\.(\d+)")
_LIST = re.compile(r"\d+(?:\s*,\s*\d+)*")


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedChoice:
    """What `--seeds` asked for."""

    count: int | None = None  # auto: how many; None: as many as each case says
    given: tuple[int, ...] | None = None  # these; None: drawn from the commit

    @property
    def needs_commit(self) -> bool:
        """Whether the seeds come from the commit's hash."""
        return self.given is None


def parse_seeds(text: str) -> SeedChoice:
    """Read `auto`, `auto:30`, `1,2,3` or `5..20` (both ends included).

    Raises:
        InputError: it is none of these.
    """
    text = text.strip()
    if match := _AUTO.fullmatch(text):
        count = None if match[1] is None else int(match[1])
        if count is None or 1 <= count <= MAX_COUNT:
            return SeedChoice(count=count)
    elif match := _RANGE.fullmatch(text):
        first, last = int(match[1]), int(match[2])
        if first <= last < MAX_SEED and last - first < MAX_COUNT:
            return SeedChoice(given=tuple(range(first, last + 1)))
    elif _LIST.fullmatch(text):
        seeds = tuple(dict.fromkeys(int(part) for part in text.split(",")))
        if max(seeds) < MAX_SEED:
            return SeedChoice(given=seeds)
    raise InputError.single(
        source=f"--seeds {text}",
        wrong="this names no seeds",
        right=f"write auto:30, or 1,2,3, or 5..20; seeds are below 2^31, at most {MAX_COUNT} of them",
    )


def drawn_seeds(commit: str, case: str, count: int) -> tuple[int, ...]:
    """Draw distinct seeds from a commit's hash: sha256 of commit, name of the case and a counter, the first 31 bits.

    Args:
        commit: the commit's full hash.
        case: name of the case, so that cases do not share seeds.
        count: how many.
    """
    seeds: dict[int, None] = {}
    counter = 0
    while len(seeds) < count:
        digest = hashlib.sha256(f"{commit}\n{case}\n{counter}".encode()).digest()
        seeds.setdefault(int.from_bytes(digest[:4], "big") % MAX_SEED)
        counter += 1
    return tuple(seeds)
