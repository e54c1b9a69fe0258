"""The table on the terminal: ours beside the published, the better one marked."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from companion.papers.choice import Chosen
from companion.papers.rows import Row
from companion.papers.spec import PaperCase, Trials

_SMALL, _SMALL_UNITS = 0.02, ("m", "rad")  # figures below it are shown in thousandths of these units
_WIDTHS = (26, 13, 13, 13, 9)  # [characters] of the columns: a terminal of 80 holds them


def table_of(chosen: Chosen, rows: Sequence[Row]) -> Group:
    """Lay out the rows of one table or figure for a terminal of 80 columns."""
    exhibit = chosen.exhibit
    parts: list[RenderableType] = [Text(f"\n{exhibit.label}: {exhibit.title}", style="bold")]
    header = _columns()
    header.add_row("", "ours", "95 %", "published", "better", style="dim")
    parts.append(header)
    for case in exhibit.cases:
        own = [row for row in rows if row.case == case.name]
        parts.append(Text(f"{case.name}: {case.what} ({_flown(case, own)})"))
        table = _columns()
        for row in own:
            table.add_row(*_cells(row))
        parts.append(table)
    return Group(*parts)


def _columns() -> Table:
    table = Table(box=None, pad_edge=False, show_header=False, padding=(0, 1, 0, 0))
    for index, width in enumerate(_WIDTHS):
        table.add_column(width=width, no_wrap=True, justify="right" if 0 < index < 4 else "left")
    return table


def _flown(case: PaperCase, rows: Sequence[Row]) -> str:
    if case.trials is Trials.HARDWARE:
        return "the paper's hardware; not flown"
    if case.trials is Trials.COMPUTER:
        return "measured on this computer"
    return f"{rows[0].trials} flights" if rows else "not flown"


def summary_of(rows: Sequence[Row]) -> str:
    """Count the figures that are better and worse, success rates apart."""
    figures = [row for row in rows if row.unit != "1" and row.published is not None and row.compared]
    rates = [row for row in rows if row.unit == "1" and row.published is not None]
    if not figures and not rates:
        return "nothing is published to compare with"
    better = sum(row.better is True for row in figures)
    worse = [row for row in figures if row.low is not None and row.published is not None and row.low > row.published]
    below = sum(row.better is False for row in rates)
    return (
        f"{better} of {len(figures)} figures better than published, {len(worse)} significantly worse (95 %); "
        f"success rate below the published in {below} of {len(rates)} cases"
    )


def _cells(row: Row) -> tuple[str, str, str, str, str]:
    if row.unit == "1":
        interval = "" if row.low is None or row.high is None else f"{100 * row.low:.0f} - {row.high:.0%}"
        published = "-" if row.published is None else f"{row.published:.0%}"
        return f"  {row.metric}", f"{row.successes}/{row.trials}", interval, published, _mark(row)
    scale, prefix = _scale(row)
    low, high = _scaled(row.low, scale), _scaled(row.high, scale)
    return (
        escape(f"  {row.shown} [{prefix}{row.unit}]"),
        _with_spread(_scaled(row.ours, scale), _scaled(row.ours_std, scale)),
        "" if low is None or high is None else f"{_figure(low)} - {_figure(high)}",
        _with_spread(_scaled(row.published, scale), _scaled(row.published_std, scale)),
        _mark(row),
    )


def _scale(row: Row) -> tuple[float, str]:
    """Give what small lengths and angles are multiplied with for people, and the prefix of their unit then."""
    values = [value for value in (row.ours, row.published, row.ours_std, row.published_std) if value is not None]
    return (1000.0, "m") if row.unit in _SMALL_UNITS and values and max(values) < _SMALL else (1.0, "")


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else scale * value


def _with_spread(value: float | None, spread: float | None) -> str:
    if value is None:
        return "-"
    return _figure(value) + ("" if spread is None else f" ± {_figure(spread)}")


def _figure(value: float) -> str:
    if value >= 10_000.0:
        return f"{value:.0f}"
    return f"{value:.3f}" if value < 10.0 else f"{value:.4g}"  # as wide: the column holds two with ± between


def _mark(row: Row) -> str:
    if not row.compared:
        return "-"
    if row.better is None:
        return "equal" if row.ours is not None and row.published is not None else "-"
    return "[green]ours[/]" if row.better else "[red]published[/]"
