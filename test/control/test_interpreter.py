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
"""The interpreter in a drive: old objects are left out of collections, a busy thread gives way."""

import gc
import sys
import threading
import time

from kachaka_simple_control.control.drive_loop import interpreter_prepared
import pytest

#: How long a collection may take [s of the thread's CPU time].
MAX_COLLECTION = 0.002


@pytest.fixture
def many():
    """Return many objects that the collector has to search."""
    return [[number] for number in range(1_000_000)]


@pytest.fixture
def collections():
    """Return the CPU times [s] that collections of this thread take."""
    took, began = [], []

    def on_collection(phase, info):
        if phase == 'start':
            began.append(time.thread_time())
        else:
            took.append(time.thread_time() - began.pop())

    gc.callbacks.append(on_collection)
    yield took
    gc.callbacks.remove(on_collection)


def collect_as_a_drive_does():
    """Make garbage in cycles until Python has collected it many times."""
    for _ in range(200_000):
        cycle = []
        cycle.append(cycle)


@pytest.mark.slow
@pytest.mark.parametrize('is_frozen', [False, True])
def test_a_million_objects_are_not_searched(many, collections, is_frozen):
    gc.collect()
    if is_frozen:
        gc.freeze()
    kept = [[] for _ in range(100)]
    collections.clear()
    try:
        with interpreter_prepared():
            collect_as_a_drive_does()
        assert len(collections) > 20
        # The machine may be busy; without the block it is fifty times as long.
        assert sorted(collections)[-3] < MAX_COLLECTION
    finally:
        gc.unfreeze()
    assert kept


def state():
    """Return the settings of the interpreter that a drive changes."""
    return gc.isenabled(), gc.get_threshold(), gc.get_freeze_count(), sys.getswitchinterval()


@pytest.mark.parametrize('prepare', [
    lambda: None, gc.disable, lambda: gc.set_threshold(100, 5, 7), gc.freeze])
def test_afterwards_the_interpreter_is_as_it_was_found(prepare):
    enabled, thresholds = gc.isenabled(), gc.get_threshold()
    try:
        prepare()
        before = state()
        with pytest.raises(KeyError), interpreter_prepared():
            raise KeyError
        assert state() == before
    finally:
        gc.unfreeze()
        gc.set_threshold(*thresholds)
        (gc.enable if enabled else gc.disable)()


def test_a_busy_thread_holds_up_a_drive_for_less_than_a_millisecond():
    """The interpreter's own interval of 5 ms would pass each time that a drive calls DDS."""
    is_over, waits = threading.Event(), []

    def be_busy():
        while not is_over.is_set():
            sum(range(1000))

    busy = threading.Thread(target=be_busy)
    busy.start()
    try:
        with interpreter_prepared():
            for _ in range(100):
                began = time.monotonic()
                time.sleep(0)  # gives the lock away, as a call of DDS does
                waits.append(time.monotonic() - began)
    finally:
        is_over.set()
        busy.join()
    # Most, for the machine may be busy.
    assert sorted(waits)[60] < 0.002
