"""What the verbs for real vehicles say of docking missions."""

from __future__ import annotations

from companion.errors import InputError
from companion.mission.docking import names_docking


def refuse_docking(mission: str) -> None:
    """Refuse a docking mission, before anything is opened.

    Raises:
        InputError: it is one.
    """
    if names_docking(mission):
        raise InputError.single(
            source=mission,
            wrong="a docking mission cannot be flown on hardware yet: there is no driver that opens nozzles, and none "
            "that reads a gyro, the port's markers or a docking switch",
            right="simulate it by `companion sim`; what is missing stands in docs/components/docking.md",
        )
