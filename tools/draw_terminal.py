#!/usr/bin/env python3
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
Draw the content of a terminal: ``tmux capture-pane -e -p | draw_terminal.py TITLE PICTURE.svg``.

The documentation's pictures of real drives are made with this program.
"""

from __future__ import annotations

from pathlib import Path
import re
import sys

from rich.console import Console
from rich.text import Text

#: Common fonts; the picture loads no font.
FONT = "font-family: 'DejaVu Sans Mono', Menlo, Consolas, monospace;"


def main() -> None:
    """Read the terminal's lines from standard input, and write the picture."""
    title, picture = sys.argv[1:]
    # One more line, because the picture cuts off the bottom of the last line.
    lines = [*sys.stdin.read().rstrip('\n').split('\n'), '']
    texts = [Text.from_ansi(line) for line in lines]
    width = max(text.cell_len for text in texts) + 1
    with Path('/dev/null').open('w') as nowhere:
        console = Console(record=True, width=width, file=nowhere, force_terminal=True)
        for text in texts:
            console.print(text, no_wrap=True, highlight=False)
    drawn = console.export_svg(title=title, unique_id='terminal')
    drawn = re.sub(r'@font-face \{.*?\}\n', '', drawn, flags=re.DOTALL)
    drawn = re.sub(r'font-family: [^;]*;', FONT, drawn)
    lines = [line.strip() for line in drawn.splitlines() if line.strip()]
    Path(picture).write_text('\n'.join(lines) + '\n')


if __name__ == '__main__':
    main()
