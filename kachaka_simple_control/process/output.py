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
Make standard output and standard error non-blocking: text that cannot be written is dropped.

A full pipe, or a terminal after Ctrl+S, blocks each write without end.  The logger of ROS holds
Python's interpreter lock during its write, so not even a thread that stops a robot could run.
"""

from __future__ import annotations

import atexit
from collections.abc import Iterator
import contextlib
import fcntl
import io
import os
import select
import stat
import sys
import time
from typing import Any, TextIO

from kachaka_simple_control.errors import RunFaultError

STDOUT, STDERR = 1, 2
STREAMS = {STDOUT: 'stdout', STDERR: 'stderr'}
#: How long a write of Python text waits for room [s].  After one such wait without success,
#: further text is dropped at once until there is room.
FLUSH_TIMEOUT = 1.0


def open_closed_streams() -> None:
    """
    Open ``/dev/null`` for each standard stream that is closed.

    Else the next file or socket would get its descriptor, and the text of the stream.
    """
    for name, mode in ('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w'):
        if getattr(sys, name) is None:
            # open() returns the lowest free descriptor: the one of the closed stream.
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))


def escape_unencodable() -> None:
    """Let this process print what its encoding lacks as escape sequences, not fail."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')


def make_nonblocking(*descriptors: int) -> None:
    """
    Make outputs of this process (descriptors 1, 2) non-blocking, and drop text that has no room.

    Processes that share an open file share its flag ``O_NONBLOCK``, and the shell would keep it.
    So the output is opened a second time.  Where that fails (a socket, another user's terminal),
    the shared flag is set until this program exits.  Regular files are not changed.
    """
    open_closed_streams()
    for descriptor in filter(_may_block, descriptors):
        _set_nonblocking(descriptor)
    # Standard error may share the flag with standard output, and a flag may be inherited.
    for descriptor in filter(_is_nonblocking, STREAMS):
        _replace_stream(descriptor)


def make_log_nonblocking() -> None:
    """
    Make the output of the ROS logger non-blocking.

    That is standard error, or both with ``RCUTILS_LOGGING_USE_STDOUT=1``.
    """
    to_stdout = os.environ.get('RCUTILS_LOGGING_USE_STDOUT') == '1'
    make_nonblocking(*[STDOUT, STDERR] if to_stdout else [STDERR])


def make_blocking(descriptor: int) -> None:
    """Make an inherited output blocking, for this process alone."""
    if _is_nonblocking(descriptor):
        with contextlib.suppress(OSError):
            _reopen(descriptor, 0)


def discard_unread() -> None:
    """
    Write the buffered text of standard output, and drop what nobody reads in time.

    Python would wait for a reader for ever at its exit.
    """
    if not _may_block(STDOUT):
        return
    stdout = sys.stdout
    make_nonblocking(STDOUT)
    end = time.monotonic() + FLUSH_TIMEOUT
    with contextlib.suppress(OSError, ValueError, AttributeError):
        while not _is_flushed(stdout):
            if not has_room(STDOUT, max(0.0, end - time.monotonic())):
                os.dup2(os.open(os.devnull, os.O_WRONLY), STDOUT)


def print_result(text: str, name: str) -> None:
    """
    Print the result of a command to standard output.

    A reader that has ended, such as ``head``, is no error.

    :raises RunFaultError: if the text cannot be written, such as to a full disk
    """
    problem = None
    # A script's own stream stays as it is.
    encoding = getattr(sys.stdout, 'encoding', None) or 'utf-8'
    text = text.encode(encoding, 'backslashreplace').decode(encoding)
    try:
        print(text, flush=True)
    except OSError as error:
        # Python flushes again at exit, and would fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            problem = error.strerror
    if problem is not None:  # raised here, so that an earlier error stays its context
        raise RunFaultError(f'{name} cannot be printed: {problem}')


def has_room(descriptor: int, timeout: float = 0.0) -> bool:
    """
    Wait until a write to an output would not block, and return whether it would not.

    A write to an output that nobody reads any longer does not block: it fails at once.
    """
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)
    return bool(poll.poll(1e3 * timeout))


class NonblockingStream(io.RawIOBase):
    """
    An unbuffered output stream that drops data which cannot be written in time.

    A write waits up to FLUSH_TIMEOUT for room; after such a timeout, each drops its data at once
    while there is none.  A reader that has closed its end of a pipe is no error.

    :param descriptor: non-blocking; never closed here
    """

    mode = 'wb'

    def __init__(self, descriptor: int, name: str) -> None:
        self._descriptor = descriptor
        self._is_stuck = False
        self.name = name

    def fileno(self) -> int:
        """Return the file descriptor to which the stream writes."""
        return self._descriptor

    def isatty(self) -> bool:
        """Return whether the stream writes to a terminal."""
        return os.isatty(self._descriptor)

    def writable(self) -> bool:
        """Return True, because the stream can be written to."""
        return True

    def write(self, data: Any, /) -> int:
        """Write data; return its length [bytes], the dropped part included."""
        rest = memoryview(data).cast('B')
        count = len(rest)
        self._is_stuck = self._is_stuck and not has_room(self._descriptor)
        end = time.monotonic() + FLUSH_TIMEOUT
        while rest and not self._is_stuck:
            written = _write(self._descriptor, rest)
            rest = rest[written:]
            now = time.monotonic()
            if written:
                end = now + FLUSH_TIMEOUT
            else:
                self._is_stuck = now >= end or not has_room(self._descriptor, end - now)
        return count


def _write(descriptor: int, data: memoryview) -> int:
    try:
        return os.write(descriptor, data)
    except BlockingIOError:
        return 0
    except OSError:  # no reader is left
        return len(data)


def _is_flushed(stream: TextIO) -> bool:
    try:
        stream.flush()
    except BlockingIOError:
        return False
    return True


def _may_block(descriptor: int) -> bool:
    try:
        mode = os.fstat(descriptor).st_mode
        can_be_full = stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or os.isatty(descriptor)
        return can_be_full and os.get_blocking(descriptor)
    except OSError:  # closed
        return False


def _is_nonblocking(descriptor: int) -> bool:
    try:
        return not os.get_blocking(descriptor)
    except OSError:  # closed
        return False


def _set_nonblocking(descriptor: int) -> None:
    try:
        _reopen(descriptor, os.O_NONBLOCK)
    except OSError:
        os.set_blocking(descriptor, False)
        atexit.register(_restore_blocking, descriptor)


def _reopen(descriptor: int, flags: int) -> None:
    access = fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE
    opened = os.open(f'/proc/self/fd/{descriptor}', access | flags | os.O_NOCTTY)
    os.dup2(opened, descriptor)
    os.close(opened)


def _restore_blocking(descriptor: int) -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            stream.flush()
    with contextlib.suppress(OSError):
        os.set_blocking(descriptor, True)


def _replace_stream(descriptor: int) -> None:
    """
    Replace ``sys.stdout`` or ``sys.stderr`` with a stream that drops text if there is no room.

    Python's own raises BlockingIOError there.
    """
    name = STREAMS[descriptor]
    original: TextIO | None = getattr(sys, f'__{name}__')
    if not isinstance(original, io.TextIOWrapper) or isinstance(
            original.buffer, NonblockingStream):
        return
    with contextlib.suppress(OSError, ValueError):
        if original.fileno() != descriptor:
            return
    with contextlib.suppress(OSError, ValueError):
        original.flush()
    # Without a buffer: a buffer has a lock.  If a thread waits for room and holds this lock when
    # Python exits, the interpreter aborts.
    stream = io.TextIOWrapper(
        NonblockingStream(descriptor, original.name),
        encoding=original.encoding, errors=original.errors,
        line_buffering=original.line_buffering, write_through=original.write_through)
    if getattr(sys, name) is original:
        setattr(sys, name, stream)
    setattr(sys, f'__{name}__', stream)


@contextlib.contextmanager
def print_only_on_success() -> Iterator[None]:
    """
    Hold back text for standard error in a ``with`` block; drop it if the block raises an error.

    This includes text from the C code of ROS.
    """
    sys.stderr.flush()
    try:
        terminal = os.dup(STDERR)
    except OSError:  # it is closed
        yield
        return
    with os.fdopen(os.memfd_create('stderr'), 'w+b', buffering=0) as printed:
        os.dup2(printed.fileno(), STDERR)
        try:
            yield
            printed.seek(0)
            with contextlib.suppress(OSError):  # a full disk
                os.write(terminal, printed.read())
        finally:
            os.dup2(terminal, STDERR)
            os.close(terminal)
