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
Convert inches, fractions, km/h and the like to the units that motion files take.

Tested by test/files/test_wording.py.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
import re

#: The characters of a Japanese keyboard, the space too, that have a narrow form.
_NARROW = {
    **{code: code - 0xfee0 for code in range(0xff01, 0xff5f)}, 0x3000: 0x20, 0x30fc: 0x2d,
    0x2010: 0x2d, 0x2011: 0x2d, 0x2012: 0x2d, 0x2013: 0x2d}
_FRACTION = re.compile(r'([-+]?[0-9]{1,9})/([0-9]{1,9}) *(.*)', re.DOTALL)
_NUMBER = re.compile(r'([-+]?(?:[0-9]+[.]?[0-9]*|[.][0-9]+)(?:[eE][-+]?[0-9]+)?) *(.*)', re.DOTALL)
_LENGTHS = {
    0.0254: ('in', 'inch', 'inches', '"'), 0.3048: ('ft', 'foot', 'feet', "'"),
    0.9144: ('yd', 'yard', 'yards'), 1609.344: ('mi', 'mile', 'miles'),
    1000.0: ('km', 'kilometre', 'kilometres', 'kilometer', 'kilometers'), 0.1: ('dm',),
    1.0: ('metre', 'metres', 'meter', 'meters'),
    0.01: ('centimetre', 'centimetres', 'centimeter', 'centimeters'),
    0.001: ('millimetre', 'millimetres', 'millimeter', 'millimeters')}
_TIMES = {
    1.0: ('sec', 'secs', 'second', 'seconds'), 0.001: ('msec', 'millisecond', 'milliseconds'),
    60.0: ('minute', 'minutes', 'mins'), 3600.0: ('h', 'hour', 'hours')}
_ANGLES = {
    math.tau: ('turn', 'turns', 'rev', 'revs', 'revolution', 'revolutions'),
    math.pi: ('pi', 'π'), math.pi / 200.0: ('gon', 'grad'),
    math.pi / 180.0: ('degree', 'degrees', 'degs'), 1.0: ('radian', 'radians', 'rads')}
_SPEEDS = {1.0 / 3.6: ('km/h', 'kmh', 'kph'), 0.44704: ('mph', 'mi/h'), 0.3048: ('ft/s', 'fps'),
           0.0254: ('in/s',), 1.0: ('m/sec',)}
_TURNS = {math.tau / 60.0: ('rpm',), math.pi / 180.0: ('deg/sec', 'degrees/s'), 1.0: ('rad/sec',)}
#: The size of each foreign unit, by the SI unit of its quantity.
_FOREIGN = {
    unit: {name: size for size, names in units.items() for name in names}
    for unit, units in (('m', _LENGTHS), ('s', _TIMES), ('rad', _ANGLES), ('m/s', _SPEEDS),
                        ('rad/s', _TURNS))}
#: The units in which a converted number is shown, the first of them from this size on.
_SHOWN = {
    'm': (('m', 1.0), ('cm', 0.01)), 's': (('s', 1.0),), 'rad': (('deg', math.pi / 180.0),),
    'm/s': (('m/s', 1.0),), 'rad/s': (('deg/s', math.pi / 180.0),)}


def narrowed(text: str) -> str:
    """Return a text with the narrow forms of its full-width characters."""
    return text.translate(_NARROW)


def in_known_units(text: str, units: Mapping[str, tuple[float, float]]) -> str | None:
    """
    Return a quantity in a unit that files take; None if it is not understood.

    :param text: a number or a fraction and a unit, as in ``10 in`` or ``1/2 m``
    :param units: the units that files take, the SI unit first, with their sizes
    """
    plain = narrowed(text).strip()
    if found := _FRACTION.fullmatch(plain):
        if not (below := int(found[2])):
            return None
        number, unit = int(found[1]) / below, found[3]
    elif found := _NUMBER.fullmatch(plain):
        number, unit = float(found[1]), found[2]
    else:
        return None
    if unit in units:
        return f'{_rounded(number)} {unit}'
    si = next(iter(units))
    size = _FOREIGN.get(si, {}).get(unit.lower())
    if size is None:
        return None
    value = number * size
    shown, scale = next(
        (one for one in _SHOWN[si] if abs(value) >= one[1]), _SHOWN[si][-1])
    return f'{_rounded(value / scale)} {shown}'


def _rounded(number: float) -> str:
    exact = f'{number:.4g}'
    return exact if math.isclose(float(exact), number, rel_tol=1e-9) else f'{number:.2g}'
