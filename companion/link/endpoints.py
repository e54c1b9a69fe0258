"""Connection URLs: where the autopilot's MAVLink comes from."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass
from urllib.parse import parse_qsl

from companion.errors import InputError

UDP_PORT = 14540
TCP_PORT = 5760
BAUD = 921600
BAUDS = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 576000, 921600, 1000000, 1500000, 2000000, 3000000)
EXAMPLES = ("udp://127.0.0.1:14540", "tcp://127.0.0.1:5760", "serial:///dev/ttyHS1?baud=921600")


@dataclass(frozen=True, slots=True, kw_only=True)
class UdpEndpoint:
    """Where to listen."""

    host: str  # an address, not a name
    port: int

    def __str__(self) -> str:
        """Give the URL."""
        return f"udp://{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class TcpEndpoint:
    """Where to connect to."""

    host: str  # an address, not a name
    port: int

    def __str__(self) -> str:
        """Give the URL."""
        return f"tcp://{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialEndpoint:
    """Which serial device to open."""

    device: str  # absolute path
    baud: int = BAUD  # [bit/s], one of BAUDS

    def __str__(self) -> str:
        """Give the URL."""
        return f"serial://{self.device}?baud={self.baud}"


Endpoint = UdpEndpoint | TcpEndpoint | SerialEndpoint


def parse_endpoint(url: str, *, source: str = "--connect") -> Endpoint:
    """Read a connection URL.

    `udp://ADDRESS:PORT` is the local address to listen on; `tcp://ADDRESS:PORT` the address to connect to;
    `serial:///dev/DEVICE?baud=RATE` the device to open.

    Args:
        url: the text.
        source: where it stands, for the error message.

    Raises:
        InputError: it is not such a URL.
    """
    try:
        return _parsed(url)
    except _WrongUrlError as error:
        raise InputError.single(source=source, wrong=f"{url!r}: {error.wrong}", right=error.right) from None


class _WrongUrlError(Exception):
    def __init__(self, wrong: str, right: str) -> None:
        super().__init__(wrong)
        self.wrong = wrong
        self.right = right


def _parsed(url: str) -> Endpoint:
    scheme, separator, rest = url.strip().partition("://")
    if not separator:
        raise _WrongUrlError("a connection needs a scheme", f"write it as one of {', '.join(EXAMPLES)}")
    if scheme == "udp":
        host, port = _host_and_port(rest, UDP_PORT, EXAMPLES[0])
        return UdpEndpoint(host=host, port=port)
    if scheme == "tcp":
        host, port = _host_and_port(rest, TCP_PORT, EXAMPLES[1])
        return TcpEndpoint(host=host, port=port)
    if scheme == "serial":
        return _serial(rest)
    raise _WrongUrlError(f"unknown scheme {scheme!r}", f"write it as one of {', '.join(EXAMPLES)}")


def _host_and_port(text: str, default_port: int, example: str) -> tuple[str, int]:
    right = f"write it as {example}"
    match = re.fullmatch(r"(\[[^\]]*\]|[^:/?\[\]]*)(?::([^/?:]*))?/?", text)
    if match is None:
        raise _WrongUrlError("not a host and a port", right)
    host, port_text = match.group(1).strip("[]"), match.group(2)
    if host == "localhost":
        host = "127.0.0.1"
    try:
        ipaddress.ip_address(host)
    except ValueError:
        raise _WrongUrlError(f"{host!r} is not an IP address" if host else "the address is missing", right) from None
    if port_text is None:
        return host, default_port
    if not re.fullmatch(r"[0-9]{1,5}", port_text) or not 0 < int(port_text) < 65536:
        raise _WrongUrlError(f"{port_text!r} is not a port", "a port is a number from 1 to 65535")
    return host, int(port_text)


def _serial(text: str) -> SerialEndpoint:
    device, _, query = text.partition("?")
    if not device.startswith("/") or device.endswith("/"):
        right = f"name the device by its whole path: {EXAMPLES[2]}"
        raise _WrongUrlError("the path of the device is missing" if not device else f"{device!r} is no device", right)
    if not query and re.search(r":[0-9]*$", device):
        raise _WrongUrlError("no rate stands there", f"write it as {EXAMPLES[2]}")
    options = dict(parse_qsl(query, keep_blank_values=True)) if query else {}
    baud_text = options.pop("baud", str(BAUD))
    if options or (query and "baud=" not in query):
        raise _WrongUrlError(f"unknown option {', '.join(options) or query}", "the only option is baud=RATE")
    rates = ", ".join(map(str, BAUDS))
    if not re.fullmatch(r"[0-9]{1,7}", baud_text) or int(baud_text) not in BAUDS:
        raise _WrongUrlError(f"{baud_text!r} is not a rate of serial lines", f"the rates are {rates}")
    return SerialEndpoint(device=device, baud=int(baud_text))


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
