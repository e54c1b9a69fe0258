"""The picture of a flight, and the page that holds it."""

from companion.report.page import write_page
from companion.report.picture import draw_flight

__all__ = ["draw_flight", "write_page"]
