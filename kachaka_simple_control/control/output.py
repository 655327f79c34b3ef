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
Standard output and standard error that never block: what finds no room is dropped.

A full pipe, or a terminal after Ctrl+S, blocks each write to it for ever.  ROS's logger writes
in C and keeps Python's interpreter lock meanwhile, so that no thread runs, not even one that
stops a robot.
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

STDOUT, STDERR = 1, 2
STREAMS = {STDOUT: 'stdout', STDERR: 'stderr'}
#: How long Python's own text waits for room [s], if there has been some since the last time.
FLUSH_TIMEOUT = 1.0


def open_closed_streams() -> None:
    """
    Open ``/dev/null`` where a standard stream is closed.

    A file or a socket that is opened later would get its number, and be written to.
    """
    for name, mode in ('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w'):
        if getattr(sys, name) is None:
            # It gets the lowest number that is free: that of the stream.
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_RDWR), mode))


def make_nonblocking(*descriptors: int) -> None:
    """
    Make outputs non-blocking for this process, and Python's streams drop what finds no room.

    Where possible the output is opened anew, for ``O_NONBLOCK`` belongs to all processes that
    share an open file: a shell would keep it.  Elsewhere (a socket, the terminal of another user)
    the flag is set until this program exits.  Regular files are left as they are.

    :param descriptors: 1, 2 or both
    """
    open_closed_streams()
    for descriptor in filter(_may_block, descriptors):
        _set_nonblocking(descriptor)
    # Standard error may share the flag with standard output, and either may have been inherited.
    for descriptor in filter(_is_nonblocking, STREAMS):
        _replace_stream(descriptor)


def make_log_nonblocking() -> None:
    """Make the output of ROS's logger non-blocking."""
    to_stdout = os.environ.get('RCUTILS_LOGGING_USE_STDOUT') == '1'
    make_nonblocking(*[STDOUT, STDERR] if to_stdout else [STDERR])


def make_blocking(descriptor: int) -> None:
    """Make an inherited output blocking, for this process alone."""
    if _is_nonblocking(descriptor):
        with contextlib.suppress(OSError):
            _reopen(descriptor, 0)


def discard_unread() -> None:
    """Drop what standard output does not take; Python would wait for that when it exits."""
    if not _may_block(STDOUT):
        return
    stdout = sys.stdout
    make_nonblocking(STDOUT)
    end = time.monotonic() + FLUSH_TIMEOUT
    with contextlib.suppress(OSError, ValueError, AttributeError):
        while not _is_flushed(stdout):
            if not has_room(STDOUT, max(0.0, end - time.monotonic())):
                os.dup2(os.open(os.devnull, os.O_WRONLY), STDOUT)


def has_room(descriptor: int, timeout: float = 0.0) -> bool:
    """
    Wait until an output can be written to.

    :param timeout: how long to wait [s]
    :returns: whether it can; True as well if it has no reader left, which a write finds at once
    """
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)
    return bool(poll.poll(1e3 * timeout))


class NonblockingStream(io.RawIOBase):
    """
    A raw stream on a non-blocking descriptor: what finds no room in time is dropped.

    It waits once: until there is room again, all further data is dropped at once.  A reader that
    is gone is no error either.

    :param descriptor: where to write; it stays open
    """

    mode = 'wb'

    def __init__(self, descriptor: int, name: str) -> None:
        self._descriptor = descriptor
        self._is_stuck = False
        self.name = name

    def fileno(self) -> int:
        """Return the descriptor."""
        return self._descriptor

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return os.isatty(self._descriptor)

    def writable(self) -> bool:
        """Return True."""
        return True

    def write(self, data: Any, /) -> int:
        """
        Write what there is room for, and drop the rest.

        :returns: the length of all data [bytes]
        """
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
    """Replace Python's own stream, which would raise BlockingIOError, by a non-blocking one."""
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
    # Without a buffer between: the lock of one, held by a thread that waits for room when Python
    # exits, would abort the interpreter.
    stream = io.TextIOWrapper(
        NonblockingStream(descriptor, original.name),
        encoding=original.encoding, errors=original.errors,
        line_buffering=original.line_buffering, write_through=original.write_through)
    if getattr(sys, name) is original:
        setattr(sys, name, stream)
    setattr(sys, f'__{name}__', stream)


@contextlib.contextmanager
def print_only_on_success() -> Iterator[None]:
    """Hold back what ROS's C code prints to standard error; drop it if the block raises."""
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
