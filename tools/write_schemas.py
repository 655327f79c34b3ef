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
"""Write the JSON Schemas again after a change to a step, a quantity or a message."""

import json
from pathlib import Path
import re
from typing import Any

import kachaka_simple_control
from kachaka_simple_control.files import (
    fleet_file,
    floor_file,
    motion_schema,
    protocol,
    robot_profile,
)
from kachaka_simple_control.files.document import read_schema
from kachaka_simple_control.files.editor_schema import editor_schema, fleet_editor_schema
from kachaka_simple_control.motion.units import QUANTITIES


def main() -> None:
    """Write the schema files of the package, which editors use."""
    write(motion_schema.SCHEMA, editor_schema())
    write(robot_profile.SCHEMA, read_schema(robot_profile.SCHEMA))
    write(fleet_file.SCHEMA, fleet_editor_schema())
    write(floor_file.SCHEMA, read_schema(floor_file.SCHEMA))
    write(protocol.SCHEMA, protocol.protocol_schema())


def with_quantity(schema: dict[str, Any]) -> dict[str, Any]:
    """Return a schema with the text format of its quantity, if it has one and is no step."""
    quantity = QUANTITIES.get(str(schema.get('quantity')))
    if quantity is None or 'properties' in schema:
        return schema
    return {**schema, **motion_schema.quantity_schema(
        quantity, bool(schema.get('expressions')))}


def write(path: str, schema: dict[str, Any]) -> None:
    """Write a schema file in the package, with each list of words on one line."""
    schema = json.loads(json.dumps(schema), object_hook=with_quantity)
    text = json.dumps(schema, indent=2, ensure_ascii=False)
    text = re.sub(r'\[\n[^][{}]*\]', lambda found: re.sub(r'\s*\n\s*', ' ', found[0]), text)
    target = Path(kachaka_simple_control.__file__).parent / path
    target.write_text(text.replace('[ ', '[').replace(' ]', ']') + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
