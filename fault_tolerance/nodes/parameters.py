# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Node parameters as data: one table declares, checks and describes them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as NodeParameter

from fault_tolerance.errors import FaultToleranceError

_Settings = TypeVar('_Settings')
Value = bool | int | float | str | tuple[float, ...]
Check = Callable[[dict[str, Any]], object]
"""Validates values before they are set; raises `FaultToleranceError` or ValueError."""

# Declared by rclpy itself, or on demand.
_ELSEWHERE = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')


class ParameterError(FaultToleranceError, ValueError):
    """The value of the parameter ``name`` is invalid, for a ``reason``."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f'parameter {name}: {reason}')
        self.name, self.reason = name, reason


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node.

    Attributes
    ----------
    name : str
    default : bool, int, float, str or tuple of float
        Gives the type as well.
    description, unit : str
    bounds : tuple of two numbers, optional
        Lowest and highest value of a number, or of each number in a tuple.
    choices : tuple of str
        Allowed words; empty: any.
    fixed : str
        Why it cannot be set while the node runs; empty: it can, between two steps.
    """

    name: str
    default: Value
    description: str
    unit: str = ''
    bounds: tuple[float, float] | None = None
    choices: tuple[str, ...] = ()
    fixed: str = 'the node is built with it; start it anew with another value'

    @property
    def descriptor(self) -> ParameterDescriptor:
        """The descriptor that ``ros2 param describe`` shows."""
        unit = f' [{self.unit}]' if self.unit else ''
        constraints = [f'one of: {", ".join(self.choices)}'] if self.choices else []
        if self.fixed:
            constraints.append(f'fixed while the node runs: {self.fixed}')
        # Not read_only: then rclpy would refuse it without a word why.
        descriptor = ParameterDescriptor(
            description=f'{self.description}{unit}',
            additional_constraints='; '.join(constraints),
        )
        if self.bounds and isinstance(self.default, float):
            low, high = (float(bound) for bound in self.bounds)
            descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
        elif self.bounds and isinstance(self.default, int):
            low, high = (int(bound) for bound in self.bounds)
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
        return descriptor

    def understood(self, value: object) -> object:
        """Return ``value`` as it was meant: YAML reads the words on and off as true and false."""
        word = {False: 'off', True: 'on'}.get(value, '') if isinstance(value, bool) else ''
        return word if word in self.choices else value

    def checked(self, value: object) -> Value:
        """Return ``value``, of the type of the default.

        Raises `ParameterError` if type, bounds or choices are violated.
        """
        if isinstance(self.default, tuple):
            return self._checked_numbers(value)
        if type(value) is not type(self.default):
            hint = f' (write {value}.0)' if isinstance(self.default, float) and (
                type(value) is int) else ''
            self._refuse(f'{value!r} is not of type {type(self.default).__name__}{hint}')
        if self.choices and value not in self.choices:
            self._refuse(f'{value!r} is not one of {", ".join(self.choices)}')
        if isinstance(value, (int, float)):
            self._check_bounds(value)
        return value  # type: ignore[return-value]

    def _checked_numbers(self, value: object) -> tuple[float, ...]:
        numbers = tuple(value) if isinstance(value, Iterable) else ()
        if not numbers or any(type(number) is not float for number in numbers):
            self._refuse(f'{value!r} is not a list of floating point numbers')
        if len(numbers) != len(self.default):  # type: ignore[arg-type]
            self._refuse(f'has {len(numbers)} numbers, not {len(self.default)}')  # type: ignore[arg-type]
        for number in numbers:
            self._check_bounds(number)
        return numbers

    def _check_bounds(self, number: float) -> None:
        if not isfinite(number):
            self._refuse(f'{number} is not finite')
        if self.bounds and not self.bounds[0] <= number <= self.bounds[1]:
            self._refuse(f'{number} is not between {self.bounds[0]} and {self.bounds[1]}')

    def _refuse(self, reason: str) -> None:
        raise ParameterError(self.name, reason)


def given_values(node: Node) -> dict[str, Any]:
    """Return the overrides of the parameters of ``node`` before they are declared or validated."""
    # rclpy has no public access to overrides of undeclared parameters.
    overrides = getattr(node, '_parameter_overrides', {})
    return {name: parameter.value for name, parameter in overrides.items()}


def declared_values(
    node: Node,
    table: Sequence[Parameter],
    check: Check | None = None,
    elsewhere: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Declare the parameters in a ``table`` on ``node``; return their values by name.

    ``check`` validates all values together, now and before each later change. Names that begin
    with a word of ``elsewhere`` are declared elsewhere. Raises `ParameterError`, or an exception
    of rclpy, that names the parameter whose value is invalid.
    """
    known = {entry.name: entry for entry in table}
    given = given_values(node)
    for name, value in given.items():
        if name in known:
            known[name].checked(known[name].understood(value))
        elif not name.startswith((*_ELSEWHERE, *elsewhere)):
            # Not an error: a file for all nodes may hold parameters of others.
            node.get_logger().warning(f'unknown parameter {name}: ignored')
    values = {
        entry.name: entry.checked(node.declare_parameter(
            entry.name, entry.understood(given.get(entry.name, entry.default)), entry.descriptor,
            ignore_override=True,
        ).value)
        for entry in table
    }
    if check is not None:
        check(values)

    def as_meant(parameters: list[NodeParameter]) -> list[NodeParameter]:
        return [
            NodeParameter(one.name, value=known[one.name].understood(one.value))
            if one.name in known else one for one in parameters
        ]

    def on_set(parameters: list[NodeParameter]) -> SetParametersResult:
        mine = [one for one in parameters if one.name in known]
        wanted = {name: entry.checked(node.get_parameter(name).value)
                  for name, entry in known.items()}
        try:
            for one in mine:
                value = known[one.name].checked(one.value)
                if known[one.name].fixed and value != wanted[one.name]:
                    raise ParameterError(one.name, known[one.name].fixed)
                wanted[one.name] = value
            if mine and check is not None:
                check(wanted)
        except (FaultToleranceError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    # Before rclpy compares types.
    node.add_pre_set_parameters_callback(as_meant)
    node.add_on_set_parameters_callback(on_set)
    return values


def settings_from(
    kind: Callable[..., _Settings], values: dict[str, Any], **further: Any
) -> _Settings:
    """Return the dataclass ``kind`` of those ``values`` that are its fields, and of ``further``.

    Errors are those of ``kind``.
    """
    names = kind.__dataclass_fields__  # type: ignore[attr-defined]
    return kind(**{name: values[name] for name in names if name in values}, **further)
