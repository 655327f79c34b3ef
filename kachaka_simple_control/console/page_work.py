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
Do for the pages what takes time: read and write files, and plan; each in a task of its own.

Tested by test/console/test_server.py.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterable
from functools import partial
from typing import Any, TypeVar

from kachaka_simple_control.console.folder import FileExistsInFolderError, Folder, FolderError
from kachaka_simple_control.console.open_pages import OpenPages, Page
from kachaka_simple_control.console.page_protocol import (
    AskPreview,
    FileText,
    ListMotions,
    Motion,
    Motions,
    OpenFile,
    PageAnswer,
    Plan,
    SaveFile,
)
from kachaka_simple_control.console.preview import PreviewWorker
from kachaka_simple_control.files.protocol import Request

T = TypeVar('T')


class PageWork:
    """The work for the pages that takes time."""

    def __init__(self, folder: Folder, previews: PreviewWorker, pages: OpenPages) -> None:
        self.folder_name = folder.name
        self._folder, self._previews, self._pages = folder, previews, pages
        self._tasks: set[asyncio.Task[None]] = set()
        self._asked: dict[Page, AskPreview] = {}
        self._planned_for: set[Page] = set()

    def handle(self, page: Page, message: Request) -> None:
        """
        Begin to handle a message about files or plans; the answer is sent later.

        :param page: the page that has sent it
        """
        match message:
            case AskPreview():
                self._ask_preview(page, message)
            case SaveFile():
                self.spawn(self._save(page, message))
            case OpenFile():
                self.spawn(self._open(page, message))
            case ListMotions():
                self.spawn(self._list((page,), message.id))

    def spawn(self, work: Coroutine[Any, Any, None]) -> None:
        """Begin a task that ends with the console."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def close(self) -> None:
        """End all tasks and the worker, and close the folder."""
        for task in self._tasks:
            task.cancel()
        await self._previews.close()
        self._folder.close()

    async def motions(self) -> tuple[Motion, ...]:
        """Return the motions of the package and of the folder."""
        return await in_thread(self._folder.motions)

    async def read(self, name: str) -> str:
        """
        Return the text of a motion.

        :raises FolderError: if there is no such motion, or it cannot be read
        """
        return await in_thread(partial(self._folder.read, name))

    async def plan(self, ask: AskPreview) -> Plan | None:
        """Return the plan of a motion; None if it has none, or there is no time for it."""
        return (await self._previews.preview(ask)).plan

    def _ask_preview(self, page: Page, ask: AskPreview) -> None:
        old = self._asked.get(page)
        if old is not None:
            page.send(PageAnswer(old.id, False, 'replaced by a newer one'))
        self._asked[page] = ask
        if page not in self._planned_for:
            self._planned_for.add(page)
            self.spawn(self._preview(page))

    async def _preview(self, page: Page) -> None:
        try:
            while (ask := self._asked.pop(page, None)) is not None and page in self._pages:
                page.send(await self._previews.preview(ask))
        finally:
            self._planned_for.discard(page)

    async def _save(self, page: Page, message: SaveFile) -> None:
        try:
            await in_thread(partial(
                self._folder.write, message.file, message.text, message.may_overwrite))
        except FolderError as error:
            page.send(PageAnswer(
                message.id, False, str(error),
                may_overwrite=isinstance(error, FileExistsInFolderError)))
            return
        page.send(PageAnswer(message.id, True, f'{message.file} is saved'))
        await self._list(self._pages, None)

    async def _open(self, page: Page, message: OpenFile) -> None:
        try:
            text = await self.read(message.name)
        except FolderError as error:
            page.send(PageAnswer(message.id, False, str(error)))
        else:
            page.send(FileText(message.id, message.name, text))

    async def _list(self, pages: Iterable[Page], number: int | None) -> None:
        motions = await self.motions()
        for page in pages:
            page.send(Motions(number, motions))


async def in_thread(function: Callable[[], T]) -> T:
    """Run a function in another thread, and return its result."""
    return await asyncio.get_running_loop().run_in_executor(None, function)
