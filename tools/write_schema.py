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
"""Write the JSON Schema of motions anew, after a change to a class of steps."""

import json
from pathlib import Path
import re

import kachaka_simple_control
from kachaka_simple_control.files.schema import motion_schema, PATH


def main() -> None:
    """Write the file that the package has for editors."""
    path = Path(kachaka_simple_control.__file__).parent / PATH
    text = json.dumps(motion_schema(), indent=2)
    # A list of words stands in one line.
    text = re.sub(r'\[\n[^][{}]*\]', lambda found: re.sub(r'\s*\n\s*', ' ', found[0]), text)
    path.write_text(text.replace('[ ', '[').replace(' ]', ']') + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
