"""The picture and the result as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import html
import io
import os
from pathlib import Path
from typing import Any

from companion.errors import RecordingError
from companion.recording import Recording
from companion.report.picture import figure_of, open_flight
from companion.report.series import Drawn
from companion.report.words import headline, rows, subtitle

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
body {{ font: 15px/1.45 system-ui, sans-serif; color: #22303c; margin: 2rem auto; max-width: 1500px; padding: 0 1rem; }}
h1 {{ font-size: 1.4rem; margin: 0; color: {colour}; }}
p {{ color: #5d6b77; margin: .2rem 0 1rem; }}
img {{ width: 100%; height: auto; border: 1px solid #e3e8ec; }}
table {{ border-collapse: collapse; margin: 1.2rem 0; }}
th, td {{ text-align: left; vertical-align: top; padding: .25rem 1.2rem .25rem 0; border-bottom: 1px solid #e3e8ec; }}
th {{ font-weight: 600; }}
td.number {{ text-align: right; font-variant-numeric: tabular-nums; }}
</style>
</head>
<body>
<h1>{title}</h1>
<p>{subtitle}</p>
<img alt="The flight in space and over time" src="data:image/png;base64,{picture}">
{result}
{history}
</body>
</html>
"""


def write_page(source: str | os.PathLike[str] | Recording, out_html: str | os.PathLike[str]) -> None:
    """Write `flight.html`.

    Args:
        source: a recording, or the path of one.
        out_html: the page to be written.

    Raises:
        RecordingError: the recording cannot be read or holds no truth, or the page cannot be written.
    """
    flight = open_flight(source)
    buffer = io.BytesIO()
    figure_of(flight).savefig(buffer, format="png", metadata={"Software": None})
    page = page_of(flight, buffer.getvalue())
    try:
        Path(out_html).parent.mkdir(parents=True, exist_ok=True)
        Path(out_html).write_text(page, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"{os.fspath(out_html)}: the page cannot be written: {error.strerror}") from None


def page_of(flight: Drawn, png: bytes) -> str:
    """Give the page's text.

    Args:
        flight: what it is about.
        png: its picture.
    """
    result = flight.result
    good = result is not None and bool(result["success"])
    return _PAGE.format(
        title=html.escape(headline(flight)),
        subtitle=html.escape(subtitle(flight)),
        colour="#22303c" if result is None else "#2b7a3d" if good else "#b3261e",
        picture=base64.b64encode(png).decode("ascii"),
        result="" if result is None else _table(rows(result)),
        history="" if result is None else _history(result.get("mode_history", [])),
    )


def _table(entries: list[tuple[str, str]]) -> str:
    lines = [f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>" for name, value in entries]
    return "\n".join(["<table>", *lines, "</table>"])


def _history(switches: list[dict[str, Any]]) -> str:
    lines = ["<table>", "<tr><th>time [s]</th><th>mode</th><th>why</th></tr>"]
    for switch in switches:
        mode, reason = html.escape(switch["mode"].replace("_", " ")), html.escape(switch["reason"])
        lines.append(f'<tr><td class="number">{switch["t"]:.2f}</td><td>{mode}</td><td>{reason}</td></tr>')
    return "\n".join([*lines, "</table>"])
