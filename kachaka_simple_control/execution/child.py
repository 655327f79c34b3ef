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
"""Start another program of this package, wherever the package is and whoever imported it."""

from __future__ import annotations

import os
from pathlib import Path
import sys

#: The first entry of the search path is the folder the program was started in, which may be any:
#: even that of this package, where ``kachaka_simple_control`` is a file.
START = (
    'import sys; sys.path = [entry for entry in sys.path if entry]; '
    'from {module} import main; sys.exit(main())')
PACKAGE = Path(__file__).resolve().parent.parent


def command(module: str) -> list[str]:
    """
    Return what runs a module's ``main`` in a fresh Python.

    :param module: its full name
    :returns: the command, to which arguments may be added
    """
    return [sys.executable, '-c', START.format(module=module)]


def environment() -> dict[str, str]:
    """
    Return an environment in which a child finds all that this process finds.

    :returns: the environment; it works, too, where this package is not installed
    """
    entries = [Path(entry).resolve() for entry in sys.path]
    path = os.pathsep.join(str(entry) for entry in entries if entry != PACKAGE)
    return {**os.environ, 'PYTHONPATH': path}
