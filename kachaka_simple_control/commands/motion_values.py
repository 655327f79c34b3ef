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
The option ``--with``, which gives a parameter of a motion a value.

Tested by test/commands/test_cli.py.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
import re

from kachaka_simple_control.text import quoted

#: What the option does.
WITH_HELP = (
    'the value of a parameter of the motion, as in --with side=1m; once for each parameter')
#: A value that a user typed without ``--with``; the name of a file may have a ``=``, too.
_BARE = re.compile(r'[A-Za-z_]\w*=(?!.*\.ya?ml$)')


def value_argument(text: str) -> tuple[str, str]:
    """Return the name and the text of the value of ``--with NAME=VALUE``."""
    name, sign, value = (part.strip() for part in text.partition('='))
    if not sign:
        raise argparse.ArgumentTypeError(
            f'{quoted(text, 60)} has no =; write NAME=VALUE, as in side=1m')
    if not name:
        raise argparse.ArgumentTypeError(
            f'{quoted(text, 60)} has no name; write NAME=VALUE, as in side=1m')
    return name, value


def values_problem(values: Sequence[tuple[str, str]], motions: Sequence[str]) -> str | None:
    """Return what is wrong with values and motions before a file is read; None if nothing."""
    if bare := [word for word in motions if _BARE.match(word)]:
        return f'{quoted(bare[0], 60)} is no motion; write --with before each NAME=VALUE'
    if values and not motions:
        return '--with is about a motion: name it, as in square --with side=1m'
    names = [name for name, _ in values]
    if twice := next((name for name in names if names.count(name) > 1), None):
        given = ' and '.join(quoted(value, 60) for name, value in values if name == twice)
        return f'{quoted(twice, 60)} has several values by --with, {given}: give one'
    return None


def parameter_words(motions: Iterable[str]) -> list[str]:
    """Return the first part of a value for each parameter of motions, such as ``side=``."""
    from kachaka_simple_control.files.document import UnreadableFileError
    from kachaka_simple_control.files.library import text_of
    from kachaka_simple_control.files.motion_reader import read_all_parameters
    words: list[str] = []
    for motion in motions:
        try:
            _, text, _ = text_of(motion)
        except UnreadableFileError:
            continue
        words += (f'{parameter.name}=' for parameter in read_all_parameters(text))
    return words
