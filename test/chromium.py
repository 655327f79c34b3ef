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
"""Start Debian's Chromium with selenium, for tests and benchmarks of pages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next((path for path in (Path('/usr/bin/chromium'), Path('/usr/bin/chromium-browser'))
                 if path.exists()), None)
DRIVER = Path('/usr/bin/chromedriver')
IS_HERE = CHROMIUM is not None and DRIVER.exists()
MISSING = 'needs chromium and chromedriver in /usr/bin: make browser'
ARGUMENTS = (
    '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync',
    # All other hosts are unreachable: a page that needs one of them fails.
    '--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.*, EXCLUDE localhost')


def start(profile: Path, display: str | None = None, **capabilities: object) -> Any:
    """
    Start a browser with a profile, and return its selenium driver.

    :param display: the X11 screen for its windows; None for a browser without windows
    """
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    arguments = ARGUMENTS if display is not None else (*ARGUMENTS, '--headless')
    for argument in (*arguments, f'--user-data-dir={profile}'):
        options.add_argument(argument)
    for name, value in capabilities.items():
        options.set_capability(f'goog:{name}', value)
    variables = None if display is None else {**os.environ, 'DISPLAY': display}
    return webdriver.Chrome(
        options=options, service=Service(executable_path=str(DRIVER), env=variables))


@contextmanager
def browser(profile: Path) -> Iterator[Any]:
    """Yield a browser that keeps its logs, or skip the test if there is none."""
    pytest.importorskip('selenium', reason='needs selenium')
    if not IS_HERE:
        pytest.skip(MISSING)
    driver = start(profile, loggingPrefs={'performance': 'ALL', 'browser': 'ALL'})
    try:
        driver.execute_cdp_cmd('Network.enable', {})
        yield driver
    finally:
        driver.quit()
