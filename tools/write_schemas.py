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
"""Write the JSON Schemas of motions and robots again after a change to a step or a quantity."""

import json
from pathlib import Path
import re
from typing import Any

import kachaka_simple_control
from kachaka_simple_control.files.robot_profile import SCHEMA
from kachaka_simple_control.files.schema import motion_schema, PATH, read_schema


def main() -> None:
    """Write the schema files of the package, which editors use."""
    write(PATH, motion_schema())
    write(SCHEMA, read_schema(SCHEMA))


def write(path: str, schema: dict[str, Any]) -> None:
    """Write a schema file in the package, with each list of words on one line."""
    text = json.dumps(schema, indent=2, ensure_ascii=False)
    text = re.sub(r'\[\n[^][{}]*\]', lambda found: re.sub(r'\s*\n\s*', ' ', found[0]), text)
    target = Path(kachaka_simple_control.__file__).parent / path
    target.write_text(text.replace('[ ', '[').replace(' ]', ']') + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
