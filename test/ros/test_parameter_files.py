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
"""What parameter files and arguments say that has no effect."""

from kachaka_simple_control.errors import UsageError
from kachaka_simple_control.ros.parameter_files import check_parameter_files, without_effect
import pytest

pytestmark = pytest.mark.needs('yaml')
NODE = '/kachaka_simple_control'


@pytest.fixture
def arguments(tmp_path):
    """Return a function that writes a parameter file, and returns the arguments that name it."""
    def write(text):
        (tmp_path / 'own.yaml').write_text(text)
        return ['--ros-args', '--params-file', str(tmp_path / 'own.yaml')]
    return write


@pytest.mark.parametrize('text', [
    'rate: 20.0', 'kachaka_simple_control: {rate: 20.0}', '/**: {rate: 20.0}',
    'ns: {node: {rate: 20.0, ros__parameters: {rate: 20.0}}}'])
def test_parameters_outside_of_ros_parameters_are_refused(arguments, text):
    with pytest.raises(UsageError, match=r"own.yaml: 'rate' stands outside of ros__parameters: w"):
        check_parameter_files(arguments(text))


@pytest.mark.parametrize('name', [
    'kachaka_simple_control', '/kachaka_simple_control', '/**', '/*', '"**"'])
def test_a_file_with_an_entry_for_this_node_is_read(arguments, name):
    words = arguments(f'{name}: {{ros__parameters: {{rate: 20.0}}}}\nx: {{ros__parameters: {{}}}}')
    check_parameter_files(words)
    assert without_effect(words, NODE) == []


@pytest.mark.parametrize(('name', 'hint'), [
    ('kachaka_simple_contrl', f'; did you mean {NODE}?'), ('bridge', '')])
def test_a_file_with_no_entry_for_this_node_says_so(arguments, name, hint):
    warning, = without_effect(arguments(f'{name}: {{ros__parameters: {{rate: 20.0}}}}'), NODE)
    assert warning.endswith(
        f'has no parameters for this node, {NODE}: its entries are for /{name}{hint}')


def test_a_parameter_for_another_node_is_said(arguments):
    assert without_effect(['-p', 'kachaka_simple_control:rate:=5', '-p', 'rate:=5'], NODE) == []
    assert without_effect(['-p', 'other:rate:=5'], NODE) == [
        f'-p other:rate is for the node other, and this is {NODE}: leave out other:']


@pytest.mark.parametrize('text', ['', '- 1', '{', 'a: [1', '\x00'])
def test_what_is_no_parameter_file_is_left_to_ros(arguments, text):
    check_parameter_files(arguments(text))
    check_parameter_files(['--params-file', 'missing.yaml'])
    check_parameter_files(['--params-file'])
