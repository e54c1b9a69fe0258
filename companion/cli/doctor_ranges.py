"""What `companion doctor` hears of ranging anchors."""

from __future__ import annotations

import asyncio

from companion.clock import Clock
from companion.errors import VehicleError
from companion.preflight.ranging import RangingReport
from companion.ranging.parameters import RangingParameters
from companion.ranging.source import RangingRemark, open_ranging
from companion.ranging.survey_file import load_survey

_POLL_S = 0.02


async def listen_to_ranges(
    parameters: RangingParameters, clock: Clock, seconds: float, *, needed: bool
) -> RangingReport:
    """Listen to the ranging input for a while.

    Args:
        parameters: which input.
        clock: stamps arrivals.
        seconds: how long [s].
        needed: the mission flies by ranges.

    Raises:
        InputError: the input or the survey is wrong.
    """
    if parameters.survey is None:
        return RangingReport(input=parameters.input, needed=needed)
    survey = load_survey(parameters.survey)
    try:
        source = await open_ranging(parameters, survey, clock)
    except VehicleError as error:
        return RangingReport(input=parameters.input, needed=needed, failure=str(error), survey=survey)
    if source is None:
        return RangingReport(input=parameters.input, needed=needed)
    t_end = clock.now() + seconds
    remarks: list[str] = []
    try:
        while clock.now() < t_end:
            source.poll(clock.now())
            remarks += [str(event) for event in source.events() if isinstance(event, RangingRemark)]
            await asyncio.sleep(_POLL_S)
    finally:
        await source.close()
    return RangingReport(
        input=parameters.input,
        needed=needed,
        survey=survey,
        seconds=seconds,
        silence=source.silence(clock.now()),
        statistics=source.statistics(),
        remarks=remarks,
    )
