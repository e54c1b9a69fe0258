"""Whether the world in which a mission is simulated is in order. Who knows the simulator says it; here nobody does."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from companion.documents import Document
from companion.errors import Problem

WrongWithWorld = Callable[[str], str | None]  # says what is wrong with a world; None: nothing


def check_world(document: Document, world: str | None, wrong_with: WrongWithWorld) -> Iterator[Problem]:
    """Yield what is wrong with the world that an opened mission names; None: it names none, and has the default."""
    wrong = None if world is None else wrong_with(world)
    if wrong is not None:
        right = "name a world of the simulator, or a world file"
        yield document.problem(("simulation", "world"), wrong=wrong, right=right)
