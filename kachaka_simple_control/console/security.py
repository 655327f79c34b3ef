# Copyright 2026 kachaka_simple_control contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""
Decide who may see the page and who may drive, and bound what a connection may send.

A browser sends requests for every page that it shows, also for pages of other sites.  So a request
must name this console as its host (against DNS rebinding), and whatever can change something must
come from a page of this console (against cross-site requests).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
import ipaddress
import secrets
import socket
from typing import Literal

#: What somebody may do: look, stop and pause; or drive as well.
Role = Literal['viewer', 'driver']
#: The header fields of each response.
HEADERS = {
    'Content-Security-Policy': (
        "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
        "object-src 'none'"),
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cache-Control': 'no-store',
}
#: The largest size of a message from a page [bytes].
MAX_MESSAGE = 64_000
#: The largest rate of the velocities of a hand, and of all other messages, of one page [Hz].
HAND_RATE = 60.0
OTHER_RATE = 20.0
#: How many pages may be open at once.
MAX_PAGES = 16
#: The random bytes of a token.
TOKEN_SIZE = 24


def is_loopback(host: str) -> bool:
    """Return whether only programs of this machine can connect to an address."""
    try:
        return ipaddress.ip_address(host.strip('[]')).is_loopback
    except ValueError:
        return host == 'localhost'


def allowed_hosts(host: str, port: int, names: Iterable[str] = ()) -> frozenset[str]:
    """Return the values of the header field Host with which a browser may ask for this console."""
    hosts = {'127.0.0.1', 'localhost', '::1', host, *names}
    if host in ('0.0.0.0', '::'):
        own = socket.gethostname()
        hosts |= {own, f'{own}.local'}
    return frozenset(f'{bracketed(name.lower())}:{port}' for name in hosts)


def bracketed(host: str) -> str:
    """Return a host as it is written in a URL, with brackets around an IPv6 address."""
    return f'[{host}]' if ':' in host and not host.startswith('[') else host


@dataclass(frozen=True)
class Tokens:
    """The secrets of the two links: each shows the page, the driver's one may drive."""

    driver: str = field(default_factory=lambda: secrets.token_urlsafe(TOKEN_SIZE), repr=False)
    viewer: str = field(default_factory=lambda: secrets.token_urlsafe(TOKEN_SIZE), repr=False)

    def role(self, token: str) -> Role | None:
        """Return what somebody with a token may do; None if it is no token of this console."""
        # Each comparison takes the same time, wherever the texts differ.
        given = token.encode('utf-8', 'surrogatepass')
        is_driver = secrets.compare_digest(given, self.driver.encode())
        is_viewer = secrets.compare_digest(given, self.viewer.encode())
        return 'driver' if is_driver else 'viewer' if is_viewer else None


@dataclass(frozen=True)
class Access:
    """
    Who may do what.

    :param tokens: the secrets; None if everybody who can connect may drive
    """

    hosts: frozenset[str]
    tokens: Tokens | None
    port: int

    @property
    def cookie(self) -> str:
        """Return the name of the cookie with the token."""
        # Consoles at several ports of a host share their cookies.
        return f'kachaka_console_{self.port}'

    def is_own_host(self, host: str | None) -> bool:
        """Return whether a request is for this console."""
        return host is not None and host.lower() in self.hosts

    def is_own_origin(self, origin: str | None) -> bool:
        """
        Return whether a request comes from a page of this console.

        :param origin: the header field Origin; browsers send it with each WebSocket and POST
        """
        scheme, separator, host = (origin or '').lower().partition('://')
        return bool(separator) and scheme == 'http' and host in self.hosts

    def is_same_origin(self, origin: str | None, host: str | None) -> bool:
        """Return whether a request comes from a page that was loaded by the same name."""
        return (self.is_own_host(host) and self.is_own_origin(origin)
                and (origin or '').lower() == f'http://{(host or "").lower()}')

    def role(self, cookies: str | None) -> Role | None:
        """Return what the sender of a request may do; None if it may not even look."""
        if self.tokens is None:
            return 'driver'
        try:
            found = SimpleCookie(cookies or '').get(self.cookie)
        except CookieError:
            return None
        return None if found is None else self.tokens.role(found.value)

    def set_cookie(self, token: str) -> str:
        """Return the header field Set-Cookie that keeps a token in the browser."""
        return f'{self.cookie}={token}; Path=/; HttpOnly; SameSite=Strict'


class RateLimit:
    """A limit of how often something may happen; short bursts are allowed."""

    def __init__(self, rate: float, now: float) -> None:
        self._rate, self._left, self._time = rate, rate, now

    def allows(self, now: float) -> bool:
        """Return whether it may happen now; if so, it counts."""
        if not self.has_left(now):
            return False
        self._left -= 1.0
        return True

    def has_left(self, now: float) -> bool:
        """Return whether it may happen now, without counting it."""
        self._left = min(self._rate, self._left + (now - self._time) * self._rate)
        self._time = now
        return self._left >= 1.0
