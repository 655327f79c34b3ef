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
"""The argument parser of all commands; apart from them, so that each imports only its own."""

from __future__ import annotations

import argparse
from typing import NoReturn

from kachaka_simple_control.escaping import escaped
from kachaka_simple_control.exit_codes import BAD_USAGE


class OneLineParser(argparse.ArgumentParser):
    """A parser whose error messages are one line, whatever was typed."""

    def error(self, message: str) -> NoReturn:
        """Print a message and exit with code 2."""
        self.exit(BAD_USAGE, f'{self.prog}: {escaped(message, 300)}\n')
