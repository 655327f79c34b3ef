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
"""What to write in a motion's file instead of what people write."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import re
from typing import Any

from kachaka_simple_control.motion.foreign_units import narrowed

#: The steps that people write, each with the step that it is and the sign of its value.
_STEPS = {
    **dict.fromkeys(('backward', 'backwards', 'back', 'reverse'), ('forward', -1)),
    **dict.fromkeys(('left', 'turn_left', 'rotate_left', 'ccw'), ('turn', 1)),
    **dict.fromkeys(('right', 'turn_right', 'rotate_right', 'cw'), ('turn', -1))}
_EXAMPLES = {'forward': '1 m', 'turn': '90 deg'}
_SIDEWAYS = re.compile('[0-9. ](m|cm|mm)$')
#: A line that is indented by, or begins with, what is full-width; a key; or brackets.
_WIDE_STRUCTURE = re.compile('^ *[\u3000\uff0d]|[A-Za-z_] *\uff1a|[\uff3b\uff3d\uff5b\uff5d]')
_COLON = re.compile('\uff1a *')
_LINE_END = re.compile('\r\n|\r|\n')


def step_advice(key: str, value: Any) -> str | None:
    """Return what to write for a step such as ``backward``; None if it is unknown."""
    found = _STEPS.get(key.lower())
    if found is None:
        return None
    step, sign = found
    text = value if isinstance(value, str) and value[:1].isascii() else _EXAMPLES[step]
    if step == 'turn' and _SIDEWAYS.search(text):
        return (f'no robot drives sideways: write `turn: {"-" if sign < 0 else ""}90 deg`, and '
                f'`forward: {text}` after it')
    if sign < 0:
        text = text[1:] if text.startswith('-') else f'-{text.removeprefix("+")}'
    return f'write `{step}: {text}`'


def wide_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield the lines whose keys, dashes or brackets are full-width."""
    for number, line in enumerate(_LINE_END.split(text), 1):
        code = line.partition('#')[0]
        plain = narrowed(_COLON.sub(': ', code)).strip()
        # Other lines are texts, whose words have no narrow form.
        if (_WIDE_STRUCTURE.search(code) and plain.replace('°', '').isascii()
                and not plain.startswith(('name: ', 'description: '))):
            yield number, plain


def nearest(word: str, known: Mapping[str, Any] | list[str]) -> str | None:
    """Return the known word that is most similar to a given word; None if none is similar."""
    import difflib
    close = difflib.get_close_matches(word.lower(), list(known), n=1)
    return close[0] if close else None


def did_you_mean(word: str, known: Mapping[str, Any] | list[str]) -> str:
    """
    Return advice for a user who wrote an unknown word, as in ``did you mean 'turn'?``.

    If no known word is similar, the advice lists all known words.

    :param word: the unknown word
    :param known: a list of the known words, or a mapping from each known word to its JSON Schema.
        If the schema of a known word lists the unknown word under ``synonyms``, this known word
        is suggested
    """
    parts = known if isinstance(known, Mapping) else {}
    near = next((name for name, part in parts.items()
                 if word.lower() in part.get('synonyms', [])), nearest(word, known))
    return f'did you mean {near!r}?' if near else f'known are {", ".join(known)}'
