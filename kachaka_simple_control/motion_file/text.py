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
"""The text of a file: never more than a little of it, never waiting, and only what is text."""

from __future__ import annotations

import codecs
import os
import re
import stat

from kachaka_simple_control.motion_file.problems import Problem, UnreadableFileError

#: The largest file that is read [bytes].
MAX_BYTES = 1_000_000
#: All but what YAML allows, without the line breaks that editors do not count as such.
_UNPRINTABLE = re.compile(
    '[^\t\n\r\x20-\x7e\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def read_text(path: str | os.PathLike[str]) -> str:
    """
    Return the text of a file.

    :param path: where it is
    :returns: its text
    :raises UnreadableFileError: if there is no such file, or it is no text of at most 1 MB
    """
    try:
        data = _read(path)
    except FileNotFoundError:
        raise UnreadableFileError(Problem('there is no such file')) from None
    except IsADirectoryError:
        raise UnreadableFileError(Problem('this is a folder; name a file in it')) from None
    except PermissionError:
        raise UnreadableFileError(Problem('you are not allowed to read this file')) from None
    except ValueError:
        raise UnreadableFileError(Problem('no file can have this name')) from None
    except OSError as error:
        raise UnreadableFileError(Problem(f'it cannot be read: {error.strerror}')) from None
    return decode(data)


def decode(data: bytes) -> str:
    """
    Return the text that bytes stand for.

    :param data: the bytes of a file
    :returns: its text
    :raises UnreadableFileError: if they are no text in UTF-8, or too many
    """
    if len(data) > MAX_BYTES:
        raise UnreadableFileError(_too_large())
    if data.startswith(_UTF_16):
        raise UnreadableFileError(Problem('this is text in UTF-16; save it as UTF-8'))
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        raise UnreadableFileError(Problem(
            f'byte {data[error.start]:#04x} is not UTF-8; is this a text, saved as UTF-8?',
            line=data.count(b'\n', 0, error.start) + 1)) from None


def require_text(text: str) -> str:
    """
    Require what a person can see, of a size that can be read.

    :param text: the text of a file, perhaps with a byte order mark, as some editors write
    :returns: the same
    :raises UnreadableFileError: if it is too long, or has control characters
    """
    # A character has four bytes at most, so this spares encoding what is surely too long.
    if len(text) > MAX_BYTES or len(text.encode(errors='surrogatepass')) > MAX_BYTES:
        raise UnreadableFileError(_too_large())
    found = _UNPRINTABLE.search(text)
    if found:
        raise UnreadableFileError(Problem(
            f'U+{ord(found[0]):04X} cannot be in a text; is this one, saved as UTF-8?',
            line=text.count('\n', 0, found.start()) + 1))
    return text


def _read(path: str | os.PathLike[str]) -> bytes:
    # A pipe would wait for its other end, and a device may have no end.
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        mode = os.fstat(descriptor).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError
        if not stat.S_ISREG(mode):
            raise UnreadableFileError(Problem('this is a device or a pipe, not a file'))
        parts: list[bytes] = []
        while sum(map(len, parts)) <= MAX_BYTES:
            parts.append(os.read(descriptor, MAX_BYTES + 1))
            if not parts[-1]:
                break
        return b''.join(parts)
    finally:
        os.close(descriptor)


def _too_large() -> Problem:
    return Problem(f'this is more than {MAX_BYTES} bytes, the most that is read')
