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
"""Whatever ends a recording, what was recorded by then can be read."""

import contextlib
import errno
import io
import os
from pathlib import Path

from kachaka_simple_control.control.events import OdometryReceived
from kachaka_simple_control.motion.geometry import Pose
from kachaka_simple_control.report import mcap_recorder
import pytest
from recorded_drive import RecordedDrive, TWIST
from recordings import read_with_rosbags, READERS, velocities

pytestmark = pytest.mark.needs('mcap')


@pytest.mark.parametrize('read', READERS)
def test_the_file_is_whole_after_each_flush(read, tmp_path):
    """Whatever ends the program: nothing was finished here."""
    drive = RecordedDrive(tmp_path)
    assert read(drive.file) == []
    for first in range(10, 15):
        drive.send(float(first), 10)
        until = first + 0.85
        drive.recorder.flush(until)
        assert velocities(read(drive.file), TWIST) == drive.expected(until)


def test_a_late_event_is_sorted_by_its_time(tmp_path):
    """Several threads publish events, and one may be slower than another."""
    drive = RecordedDrive(tmp_path)
    drive.send(10.0, 5)
    drive.recorder.flush(10.25)
    drive.publish(OdometryReceived(10.26, Pose()))
    drive.recorder.flush(11.0)
    for read in READERS:
        stamps = [one.stamp for one in read(drive.file)]
        assert len(stamps) == 7
        assert stamps == sorted(stamps)


def test_a_file_cut_off_in_a_part_is_readable_up_to_that_part(tmp_path):
    """A program killed within a write leaves this; `mcap recover` reads it likewise."""
    stream_reader = pytest.importorskip('mcap.stream_reader')
    drive = RecordedDrive(tmp_path)
    sizes = []
    for first in range(10, 13):
        drive.send(float(first), 10)
        drive.recorder.flush(first + 1.0)
        sizes.append(drive.file.stat().st_size)
    data = drive.file.read_bytes()
    for size in range(sizes[0], sizes[2], 7):
        whole, found = sum(size >= end for end in sizes) * 10, 0
        with contextlib.suppress(Exception):  # each cut ends it in a way of its own
            for record in stream_reader.StreamReader(io.BytesIO(data[:size])).records:
                found += type(record).__name__ == 'Message'
        assert found >= whole


def full_from(limit, monkeypatch):
    """Let no file grow beyond a size, as a full disk does: what fits is written first."""
    write = os.pwrite

    def pwrite(descriptor, data, offset):
        room = limit - offset
        if room <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data[:room], offset)

    monkeypatch.setattr(os, 'pwrite', pwrite)


@pytest.mark.parametrize('limit', range(200, 4000, 97))
def test_a_full_disk_ends_the_recording_and_leaves_what_was_there(limit, monkeypatch, tmp_path):
    full_from(limit, monkeypatch)
    drive = RecordedDrive(tmp_path)
    stored = 0
    for first in range(10, 30):
        drive.send(float(first), 10, velocity=first / 1000.0)
        drive.publish(OdometryReceived(first + 0.5, Pose(first / 7.0, first / 3.0)))
        drive.recorder.flush(first + 1.0)
        # The first part has the speed factor, too.
        stored += 0 if drive.recorder.failure else 11 + (first == 10)
    assert drive.recorder.finish() == 'run.mcap ends early: No space left on device'
    assert drive.file.stat().st_size <= limit
    for read in READERS:
        assert len(read(drive.file)) == stored
    if stored:
        assert len(read_with_rosbags(tmp_path)) == stored
    # Without messages, a file has no topics that a bag could name.
    assert (tmp_path / 'metadata.yaml').exists() == bool(stored)
    assert str(drive.file) not in [
        str(link.readlink()) for link in Path('/proc/self/fd').glob('*') if link.is_symlink()]


def test_a_full_disk_at_the_very_end_loses_only_the_index(monkeypatch, tmp_path):
    drive = RecordedDrive(tmp_path)
    drive.send(10.0, 10)
    drive.recorder.flush(20.0)
    full_from(drive.file.stat().st_size, monkeypatch)
    assert drive.recorder.finish() == 'run.mcap ends early: No space left on device'
    for read in READERS:
        assert velocities(read(drive.file), TWIST) == drive.expected()


def test_a_full_disk_after_the_recording_leaves_no_incomplete_metadata(monkeypatch, tmp_path):
    def write_text(self, text, encoding):
        self.write_bytes(text[:100].encode(encoding))
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, 'write_text', write_text)
    drive = RecordedDrive(tmp_path)
    drive.send(10.0, 10)
    assert drive.recorder.finish() == 'metadata.yaml is left out: No space left on device'
    assert list(tmp_path.iterdir()) == [drive.file]
    for read in READERS:
        assert velocities(read(drive.file), TWIST) == drive.expected()


def test_without_the_library_the_recording_is_left_out_with_a_message(monkeypatch, tmp_path):
    monkeypatch.setattr(mcap_recorder.importlib.util, 'find_spec', lambda name: None)
    drive = RecordedDrive(tmp_path)
    drive.send(10.0, 3)
    drive.recorder.flush(20.0)
    assert drive.recorder.finish() == (
        "run.mcap is left out: it needs mcap 1.5 or newer: pip install 'mcap>=1.5'")
    assert list(tmp_path.iterdir()) == []
