"""One line of the table: a figure of the stub beside PX4's, and whether it is near enough."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One comparison."""

    name: str
    """Experiment, part and figure, with its unit."""
    stub: str
    px4: str
    tolerance: str
    passed: bool


def within(name: str, stub: float, px4: float, *, share: float = 0.0, margin: float = 0.0, unit: str = "") -> Row:
    """Pass when the figures differ by at most `share` of PX4's figure or `margin`, whichever is more."""
    allowed = max(share * abs(px4), margin)
    words = [f"{100.0 * share:.0f} %"] if share else []
    words += [f"{margin:g}{unit}"] if margin else []
    passed = bool(abs(stub - px4) <= allowed)
    return Row(name=name, stub=_figure(stub, unit), px4=_figure(px4, unit), tolerance=" or ".join(words), passed=passed)


def never_in_either(name: str) -> Row:
    """Pass: what is measured happened in neither flight."""
    return Row(name=name, stub="never", px4="never", tolerance="", passed=True)


def at_most(name: str, stub: float, px4: str, limit: float, unit: str = "") -> Row:
    """Pass when a difference between both flights is small enough."""
    passed = bool(stub <= limit)
    return Row(name=name, stub=_figure(stub, unit), px4=px4, tolerance=f"<= {limit:.3g}{unit}", passed=passed)


def inside(name: str, stub: float, low: float, high: float, *, px4: str, unit: str = "") -> Row:
    """Pass when the stub's figure lies in the range that PX4's flights span."""
    passed = bool(low <= stub <= high)
    return Row(name=name, stub=_figure(stub, unit), px4=px4, tolerance=f"{low:.3g} to {high:.3g}{unit}", passed=passed)


def factor(name: str, stub: float, px4: float, limit: float, unit: str = "") -> Row:
    """Pass when the figures differ by at most a factor of `limit`."""
    passed = bool(px4 / limit <= stub <= px4 * limit)
    return Row(
        name=name,
        stub=_figure(stub, unit),
        px4=_figure(px4, unit),
        tolerance=f"factor {limit:g}",
        passed=passed,
    )


def _figure(value: float, unit: str) -> str:
    return f"{value:.3g}{unit}" if math.isfinite(value) else "never"
