"""What `companion doctor` looks at in the ranging input."""

from __future__ import annotations

import asyncio

from companion.clock import Clock
from companion.errors import CompanionError
from companion.preflight.ranging import RangingReport
from companion.ranging.parameters import NO_INPUT, RangingParameters
from companion.ranging.source import RangesSilent, RangingEvent, RangingRemark, open_ranging
from companion.ranging.survey_file import load_survey

_PAUSE_S = 0.02  # between looks


async def listen_to_ranging(ranging: RangingParameters, clock: Clock, *, needed: bool, seconds: float) -> RangingReport:
    """Listen to the ranging input for some time.

    Args:
        ranging: the section of the configuration.
        clock: stamps arrivals.
        needed: the mission flies by ranges.
        seconds: for which to listen.
    """
    if ranging.input == NO_INPUT or ranging.survey is None:
        return RangingReport(input=NO_INPUT, needed=needed)
    try:
        survey = load_survey(ranging.survey)
        source = await open_ranging(ranging, survey, clock)
    except CompanionError as error:
        return RangingReport(input=ranging.input, needed=needed, failure=str(error))
    if source is None:
        return RangingReport(input=NO_INPUT, needed=needed)
    t_start, events = clock.now(), list[RangingEvent]()
    try:
        while (t := clock.now()) < t_start + seconds:
            source.poll(t)
            events += source.events()
            await asyncio.sleep(_PAUSE_S)
        return RangingReport(
            input=ranging.input,
            needed=needed,
            survey=survey,
            seconds=t - t_start,
            silence=source.silence(t),
            statistics=source.statistics(),
            remarks=_remarks(events),
        )
    finally:
        await source.close()


def _remarks(events: list[RangingEvent]) -> list[str]:
    """Give why it was silent at last, then what else should be known; for how long is said elsewhere."""
    reasons = [event.reason for event in events if isinstance(event, RangesSilent)]
    return [*reasons[-1:], *(event.text for event in events if isinstance(event, RangingRemark))]
