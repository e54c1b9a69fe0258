"""Put STATUSTEXT chunks together."""

from __future__ import annotations

from companion.link.events import StatusText
from companion.link.incoming import StatusTextChunk

_CHUNK = 50
_WAIT = 0.5  # [s] for the next chunk
_LONGEST = 254  # chunks


class TextAssembler:
    """Holds the one text that is under way; PX4 sends the chunks of a text one after the other."""

    def __init__(self) -> None:
        self._id = 0
        self._severity = 6
        self._next = 0
        self._text = b""
        self._t = 0.0

    def take(self, chunk: StatusTextChunk, t: float) -> list[StatusText]:
        """Take a chunk; give the texts that it ends."""
        done: list[StatusText] = []
        continues = bool(self._text) and chunk.id == self._id and chunk.chunk == self._next
        if not continues:
            done += self._finish()
            self._id, self._severity, self._text = chunk.id, chunk.severity, b""
        part = chunk.text.split(b"\0", 1)[0]
        self._text += part
        self._next = chunk.chunk + 1
        self._t = t
        if chunk.id == 0 or len(part) < _CHUNK or self._next >= _LONGEST:
            done += self._finish()
        return done

    def poll(self, t: float) -> list[StatusText]:
        """Give the text whose next chunk does not come."""
        return self._finish() if self._text and t - self._t > _WAIT else []

    def _finish(self) -> list[StatusText]:
        text = "".join(c for c in self._text.decode("utf-8", "replace").strip() if c.isprintable())
        self._text = b""
        return [StatusText(t=self._t, severity=self._severity, text=text)] if text else []
