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
"""The errors that a user of the node meets."""

import pickle

from kachaka_simple_control import errors
from kachaka_simple_control.files.document import MotionFileError, Problem
from kachaka_simple_control.files.robot_profile import RobotFileError
import pytest


@pytest.mark.parametrize('error', [
    errors.LimitError(2.0, 'm/s', 1.0, 0.1, whose="the robot's", name='speed').at('steps[0]'),
    errors.InvalidMotionError('2 m', 'steps[0]', 'distance'), errors.RunFaultError('lost'),
    MotionFileError('a.yaml', [Problem('wrong', 2, 'steps')]), RobotFileError('a.yaml', [])])
def test_an_error_goes_to_another_process_whole(error):
    copy = pickle.loads(pickle.dumps(error))
    assert (type(copy), str(copy), copy.args) == (type(error), str(error), error.args)
    assert vars(copy) == vars(error)
