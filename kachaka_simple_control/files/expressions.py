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
Compute expressions such as ``2 * $side + 10 cm``: numbers with units, parameters, + - * / ( ).

Numbers are exact until the end, so that ``50 cm + 7 cm`` is 0.57 m.  Tested by
test/files/test_expressions.py.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from decimal import Decimal
import operator
import re

from kachaka_simple_control.files.amounts import (
    Amount,
    amount_of,
    dimension_of,
    unit_of,
    UNITS,
    VALUE,
)
from kachaka_simple_control.files.wording import did_you_mean
from kachaka_simple_control.motion.units import DIGITS, Quantity, sign_advice, UnitError
from kachaka_simple_control.text import quoted

#: The longest expression [characters], and the deepest parentheses.
MAX_EXPRESSION, MAX_PARENTHESES = 1000, 50
#: The largest result and the largest power of a unit, whose product is far below any overflow.
LARGEST, MAX_POWER = 10**100, 20
#: A pattern of the name of a parameter.
NAME = '[A-Za-z_][A-Za-z0-9_]*'
#: A number so near to a whole one is meant to be whole, such as three times a third.
ROUNDING = Decimal('1e-30')
_TOKEN = re.compile(rf'\s*({VALUE}|[$](?P<name>{NAME})|(?P<sign>[-+*/()]))')
_OPERATOR = re.compile(r'[$*()]|\S +[-+/] +\S')
_OPERATORS: dict[str, Callable[[Amount, Amount], Amount]] = {
    '+': operator.add, '-': operator.sub, '*': operator.mul, '/': operator.truediv}


def is_expression(text: str) -> bool:
    """Return whether a text is to be computed; without spaces a / belongs to a unit, as in m/s."""
    return bool(_OPERATOR.search(text))


def expression_pattern() -> str:
    """Return a regular expression, valid in ECMAScript, of texts that are to be computed."""
    value = f'({DIGITS}( *({UNITS}))?|[$]{NAME})'
    part = rf'[-+(\s]*{value}[)\s]*'
    return f'(?=.*({_OPERATOR.pattern})){part}([-+*/]{part})*'


def evaluate(text: str, values: Mapping[str, Amount | None] | None) -> Amount | None:
    """
    Compute an expression.

    :param values: the value of each parameter, by name, or None if it is invalid; None if no
        parameter is known yet
    :returns: None if a parameter in the expression has no value
    :raises UnitError: if the text is no expression, units do not fit, or there is no such
        parameter
    """
    return _Evaluation(text, values).result()


def compute(
        text: str, quantity: Quantity, values: Mapping[str, Amount | None] | None) -> float | None:
    """
    Return the value of a quantity, or of an expression that results in one, in the SI unit.

    :returns: None if a parameter in the expression has no value
    :raises UnitError: as ``evaluate``, and if the result is another quantity, or not allowed
    """
    if not is_expression(text):
        return quantity.parse(text)
    amount = evaluate(text, values)
    if amount is None:
        return None
    if amount.dimension != dimension_of(quantity.unit):
        raise UnitError(f'{quoted(text)} is {amount.kind}; it must be {quantity.wanted}')
    try:
        quantity.check(amount.value, str(amount))
    except UnitError as error:
        raise UnitError(f'{quoted(text)}: {error}') from None
    return amount.value


def compute_count(text: str, values: Mapping[str, Amount | None] | None) -> int | None:
    """
    Return the value of an expression that is a whole number.

    :returns: None if a parameter in the expression has no value
    :raises UnitError: as ``evaluate``, and if the result is no whole number
    """
    amount = evaluate(text, values)
    if amount is None:
        return None
    whole = round(amount.number)
    if any(amount.dimension) or abs(amount.number - whole) > ROUNDING:
        shown = f'{amount.value:.4g} {unit_of(amount.dimension)}'.rstrip()
        raise UnitError(
            f'{quoted(text)} is {shown}{_with_values(text, values)}; it must be a whole number')
    return whole


def _with_values(text: str, values: Mapping[str, Amount | None] | None) -> str:
    """Return the values of the parameters in an expression, as in `` with width 1 m``."""
    names = dict.fromkeys(re.findall(f'[$]({NAME})', text))
    found = ', '.join(f'{name} {(values or {}).get(name)}' for name in names)
    return f' with {found}' if found and text.strip() != f'${next(iter(names))}' else ''


class _Evaluation:
    """One expression that is being computed, from left to right."""

    def __init__(self, text: str, values: Mapping[str, Amount | None] | None) -> None:
        self._text, self._values = text.strip(), values
        self._position = self._depth = 0
        self._token: re.Match[str] | None = None

    def result(self) -> Amount | None:
        if len(self._text) > MAX_EXPRESSION:
            raise UnitError(
                f'{quoted(self._text)} has {len(self._text)} characters; an expression may have '
                f'{MAX_EXPRESSION} at most')
        self._advance()
        amount = self._sum()
        if self._token is not None:
            word = self._token[0].strip()
            raise self._error("a '(' is missing" if word == ')' else (
                f'an operator is missing before {quoted(word)}'))
        return amount

    def _sum(self) -> Amount | None:
        amount = self._product()
        while (sign := self._sign()) in ('+', '-'):
            self._advance()
            amount = self._combined(sign, amount, self._product())
        return amount

    def _product(self) -> Amount | None:
        amount = self._factor()
        while (sign := self._sign()) in ('*', '/'):
            self._advance()
            amount = self._combined(sign, amount, self._factor())
        return amount

    def _factor(self) -> Amount | None:
        is_negative = False
        while (sign := self._sign()) in ('+', '-'):
            is_negative ^= sign == '-'
            self._advance()
        token = self._token
        if token is None or sign in ('*', '/', ')'):
            place = 'at its end' if token is None else f'before {sign!r}'
            raise self._error(f'a number or a $parameter is missing {place}')
        if sign == '(':
            amount = self._within()
        else:
            amount = self._parameter(token['name']) if token['name'] else amount_of(token)
            self._advance()
        return -amount if is_negative and amount is not None else amount

    def _within(self) -> Amount | None:
        self._depth += 1
        if self._depth > MAX_PARENTHESES:
            raise self._error(f'parentheses are nested more than {MAX_PARENTHESES} deep')
        self._advance()
        amount = self._sum()
        if self._sign() != ')':
            raise self._error("a ')' is missing")
        self._depth -= 1
        self._advance()
        return amount

    def _parameter(self, name: str) -> Amount | None:
        if self._values is None:
            return None
        if name not in self._values:
            advice = did_you_mean(name, list(self._values)) if self._values else (
                'the file has none: give them below `parameters:`')
            raise self._error(f'there is no parameter {name!r}; {advice}')
        return self._values[name]

    def _combined(self, sign: str, one: Amount | None, two: Amount | None) -> Amount | None:
        if sign == '/' and two is not None and not two.number:
            raise self._error('it divides by 0')
        if one is None or two is None:
            return None
        if sign in ('+', '-') and one.dimension != two.dimension:
            verb = 'added' if sign == '+' else 'subtracted'
            raise self._error(f'{_shown(one)} and {_shown(two)} cannot be {verb}')
        amount = _OPERATORS[sign](one, two)
        if abs(amount.number) > LARGEST:
            raise self._error('a result is too large a number')
        if max(map(abs, (*amount.dimension, amount.degrees))) > MAX_POWER:
            raise self._error(f'a result has a unit to a power above {MAX_POWER}')
        return amount

    def _sign(self) -> str | None:
        return None if self._token is None else self._token['sign']

    def _advance(self) -> None:
        if self._position == len(self._text):
            self._token = None
            return
        self._token = _TOKEN.match(self._text, self._position)
        if self._token is None:
            rest = self._text[self._position:].strip()
            word = re.match(r'\w+|.', rest)
            raise self._error(sign_advice(self._text) or (
                f'{quoted(word[0] if word else rest)} cannot be here: numbers with units, '
                '$parameters, + - * / and ( ) can'))
        self._position = self._token.end()

    def _error(self, text: str) -> UnitError:
        return UnitError(f'{quoted(self._text)}: {text}')


def _shown(amount: Amount) -> str:
    kind = amount.kind
    return f'a value {kind}' if kind.startswith('in ') else kind
