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
"""The web server of the console: one page, its files, and the WebSocket ``/ws``."""

from __future__ import annotations

import asyncio
import contextlib
from importlib.resources import files
from mimetypes import guess_type
import socket
from typing import Any

from kachaka_simple_control.console.base_console import BaseConsole
from kachaka_simple_control.console.page_protocol import MAX_SENT
from kachaka_simple_control.console.reports import Reports
from kachaka_simple_control.console.security import (
    Access,
    allowed_hosts,
    HEADERS,
    MAX_MESSAGE,
    MAX_PAGES,
    Tokens,
)
from kachaka_simple_control.files.document import PACKAGE
from kachaka_simple_control.files.messages import Message, MessageError, to_json
from kachaka_simple_control.files.protocol import Log
import tornado.httpserver
import tornado.netutil
import tornado.web
import tornado.websocket

#: A page that leaves so much unread is closed [bytes].
MAX_BEHIND = 1_000_000
#: A page that does not answer a ping for so long is closed [s].
PING_PERIOD = 5.0
#: The largest size of a request's header [bytes].
MAX_HEADER = 16_000
#: The types of files that a machine may not know.
#: What a report may load: nothing but itself.  It may run no script and open no window.
REPORT_POLICY = (
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'; "
    'sandbox')
_TYPES = {'.js': 'text/javascript', '.css': 'text/css', '.html': 'text/html',
          '.svg': 'image/svg+xml'}
#: After the link with the token was opened, the page is loaded from its own origin.  A redirect
#: would not do: a browser that came from another site does not send the cookie with it.
_FORWARD = (b'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url=/">'
            b'<title>Console</title><a href="/">Console</a>')


def static_files(page: str) -> dict[str, tuple[str, bytes]]:
    """Return type and contents of the files of a page by path; the page itself is also ``''``."""
    found: dict[str, tuple[str, bytes]] = {}

    def collect(folder: Any, prefix: str) -> None:
        for entry in folder.iterdir():
            path = prefix + entry.name
            if entry.is_dir():
                collect(entry, path + '/')
            elif path == page or not path.endswith('.html'):
                suffix = path[path.rfind('.'):]
                kind = _TYPES.get(suffix) or guess_type(path)[0] or 'application/octet-stream'
                text = f'{kind}; charset=utf-8' if kind.startswith('text/') else kind
                found[path] = text, entry.read_bytes()

    collect(files(PACKAGE).joinpath('console').joinpath('static'), '')
    return {**found, '': found[page]}


class _Guarded(tornado.web.RequestHandler):
    """A handler that refuses the requests of other hosts and origins, and of strangers."""

    access: Access

    def initialize(self, access: Access) -> None:
        self.access = access

    def set_default_headers(self) -> None:
        for name, value in HEADERS.items():
            self.set_header(name, value)
        self.clear_header('Server')

    def prepare(self) -> None:
        headers = self.request.headers
        if len(headers.get_list('Host')) != 1 or not self.access.is_own_host(headers['Host']):
            self._refuse(421, 'this console has another host name')
        elif self.request.method not in ('GET', 'HEAD') and not self.access.is_same_origin(
                headers.get('Origin'), headers['Host']):
            self._refuse(403, 'this request comes from another site')

    def _refuse(self, status: int, reason: str) -> None:
        self.set_status(status)
        self.set_header('Content-Type', 'text/plain; charset=utf-8')
        self.finish(f'{reason}\n')

    def write_error(self, status_code: int, **_: Any) -> None:
        # Nothing of an exception is shown.
        self._refuse(status_code, 'this request cannot be answered')


class FileHandler(_Guarded):
    """The files of the page, from memory; and the links with a token."""

    pages: dict[str, tuple[str, bytes]]

    def initialize(  # type: ignore[override]
            self, access: Access, pages: dict[str, tuple[str, bytes]]) -> None:
        """Set what all handlers of this kind share."""
        super().initialize(access)
        self.pages = pages

    def head(self, path: str) -> None:
        """Answer without the file itself, which tornado leaves out."""
        self.get(path)

    def get(self, path: str) -> None:
        """Answer with a file."""
        token = self.get_query_argument('token', None)
        if token is not None and not path and self.access.tokens is not None:
            self._take_token(token)
        elif self.access.role(self.request.headers.get('Cookie')) is None:
            self._refuse(403, 'open the link that the console has printed')
        elif path in self.pages:
            kind, contents = self.pages[path]
            self.set_header('Content-Type', kind)
            self.write(contents)
        else:
            self._refuse(404, 'there is no such file')

    def _take_token(self, token: str) -> None:
        assert self.access.tokens is not None
        if self.access.tokens.role(token) is None:
            self._refuse(403, 'this link is not, or no longer, valid')
            return
        self.set_header('Set-Cookie', self.access.set_cookie(token))
        self.set_header('Content-Type', 'text/html; charset=utf-8')
        self.write(_FORWARD)


class ReportHandler(_Guarded):
    """The pages of the reports, which have their styles and pictures in themselves."""

    reports: Reports

    def initialize(self, access: Access, reports: Reports) -> None:  # type: ignore[override]
        """Set what all handlers of this kind share."""
        super().initialize(access)
        self.reports = reports

    def get(self, number: str) -> None:
        """Answer with a report."""
        if self.access.role(self.request.headers.get('Cookie')) is None:
            self._refuse(403, 'open the link that the console has printed')
        elif (page := self.reports.read(int(number))) is None:
            self._refuse(404, 'there is no such report')
        else:
            self.set_header('Content-Security-Policy', REPORT_POLICY)
            self.set_header('Content-Type', 'text/html; charset=utf-8')
            self.write(page)


class PageSocket(_Guarded, tornado.websocket.WebSocketHandler):
    """The WebSocket of a page."""

    console: BaseConsole

    def initialize(self, access: Access, console: BaseConsole) -> None:  # type: ignore[override]
        """Set what all handlers of this kind share."""
        super().initialize(access)
        self.console = console
        self._role: str | None = None
        self._unsent = 0
        self._is_open = False

    async def get(self, *args: Any, **kwargs: Any) -> None:
        """Open the WebSocket, or refuse it."""
        headers = self.request.headers
        self._role = self.access.role(headers.get('Cookie'))
        if len(headers.get_list('Origin')) != 1 or not self.access.is_same_origin(
                headers['Origin'], headers['Host']):
            self._refuse(403, 'this request comes from another site')
        elif self._role is None:
            self._refuse(403, 'open the link that the console has printed')
        elif len(self.console.pages) >= MAX_PAGES:
            self._refuse(503, f'{MAX_PAGES} pages are open; close one')
        else:
            await super().get(*args, **kwargs)

    def check_origin(self, origin: str) -> bool:
        """Return whether the page is one of this console."""
        return self.access.is_same_origin(origin, self.request.headers.get('Host'))

    @property
    def may_drive(self) -> bool:
        """Return whether the page may ask for the lease."""
        return self._role == 'driver'

    @property
    def is_behind(self) -> bool:
        """Return whether the page has not yet taken the last messages."""
        return self._unsent > MAX_BEHIND // 20

    def open(self, *_: str, **__: str) -> None:  # noqa: A003
        """Take the page."""
        self.set_nodelay(True)
        self._is_open = True
        self._take_turns()
        self.console.open_page(self)

    def on_message(self, message: str | bytes) -> None:
        """Handle a message."""
        self.console.receive(self, message)

    def _take_turns(self) -> None:
        """
        Handle one frame of each page in turn, so that a flood does not delay another's stop.

        Otherwise tornado handles all that a socket has before it looks at another socket; tornado
        6.1 looked at no other socket while pings or parts of a message came without an end.
        """
        connection: Any = self.ws_connection
        receive = connection._receive_frame  # noqa: SLF001 (it has no other place for this)

        async def receive_in_turn() -> None:
            await receive()
            await asyncio.sleep(0)

        connection._receive_frame = receive_in_turn  # noqa: SLF001

    def on_close(self) -> None:
        """Forget the page."""
        self._is_open = False
        self.console.close_page(self)

    def send(self, message: Message) -> None:
        """Send a message to the page; close a page that does not take its messages."""
        if not self._is_open:
            return
        try:
            text = to_json(message, MAX_SENT)
        except MessageError as error:
            text = to_json(Log('error', f'a message cannot be sent: {error}'))
        if self._unsent > MAX_BEHIND:
            self._drop()
            return
        try:
            sent = asyncio.ensure_future(self.write_message(text))
        except tornado.websocket.WebSocketClosedError:
            return
        self._unsent += len(text)
        sent.add_done_callback(lambda done: self._note_sent(done, len(text)))

    def _note_sent(self, done: asyncio.Future[None], size: int) -> None:
        self._unsent -= size
        if not done.cancelled():
            # A page that has gone meanwhile is reported by on_close().
            done.exception()

    def _drop(self) -> None:
        """Close the connection without waiting for the page."""
        stream = getattr(self.ws_connection, 'stream', None)
        if self._is_open and stream is not None:
            stream.close()


class ConsoleServer:
    """
    The web server of a console.

    :param port: the port; 0 for any that is free
    :param tokens: the secrets of the links; None if everybody who can connect may drive
    :raises OSError: if it cannot listen there
    """

    def __init__(
            self, console: BaseConsole, host: str = '127.0.0.1', port: int = 0,
            tokens: Tokens | None = None, names: tuple[str, ...] = ()) -> None:
        self.sockets = tornado.netutil.bind_sockets(port, host, socket.AF_UNSPEC)
        self.port: int = self.sockets[0].getsockname()[1]
        self.access = Access(allowed_hosts(host, self.port, names), tokens, self.port)
        application = tornado.web.Application(
            [(r'/ws', PageSocket, {'access': self.access, 'console': console}),
             (r'/report/(\d{1,6})', ReportHandler,
              {'access': self.access, 'reports': console.reports}),
             (r'/(.*)', FileHandler,
              {'access': self.access, 'pages': static_files(console.PAGE)})],
            websocket_max_message_size=MAX_MESSAGE, websocket_ping_interval=PING_PERIOD,
            websocket_ping_timeout=PING_PERIOD, log_function=lambda _: None)
        self._server = tornado.httpserver.HTTPServer(
            application, max_header_size=MAX_HEADER, max_body_size=MAX_MESSAGE,
            max_buffer_size=4 * MAX_MESSAGE, idle_connection_timeout=60.0)
        self._server.add_sockets(self.sockets)

    async def close(self) -> None:
        """Stop listening, and close all connections."""
        self._server.stop()
        with contextlib.suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._server.close_all_connections(), 2.0)
