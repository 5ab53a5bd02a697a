# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The service ``~/reset`` of the node ``drive_reports``: resets the drives that have failed."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import Any

from rclpy.client import Client
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.task import Future

from fault_tolerance.control.notices import clean
from fault_tolerance.drive_rules.drive_watch import DriveWatch
from fault_tolerance.drive_rules.rules import Reset
from fault_tolerance.errors import MechanismError
from fault_tolerance.nodes.late_service import Answer, LateService
from fault_tolerance.nodes.message_types import message_type


class DriveResets:
    """Calls the services that the rules name, and waits until the drives say that they are well.

    MechanismError if a request does not fit the type of its service.

    Parameters
    ----------
    node : Node
    watch : DriveWatch
        Knows which drives have failed, and what resets them.
    timeout : float
        Seconds in which services answer and drives become well.

    Attributes
    ----------
    missing : list of str
        Types of services that are not on this machine.
    """

    def __init__(self, node: Node, watch: DriveWatch, timeout: float) -> None:
        self._watch, self._timeout = watch, timeout
        self.missing: list[str] = []
        self._requests: dict[Reset, tuple[Client, Any]] = {}
        for reset in watch.resets:
            kind = message_type(reset.kind)
            if kind is not None:
                request = _request(watch.rules.source, reset, kind)
                self._requests[reset] = node.create_client(kind, reset.service), request
            elif reset.kind not in self.missing:
                self.missing.append(reset.kind)
        self._calls: dict[Reset, Future] = {}
        self._parts: dict[str, list[Reset]] = {}
        self._remarks: list[str] = []
        self._deadline = 0.0
        self._service = LateService(node, '~/reset', self._begin)

    def look(self) -> None:
        """Answer those who wait, if the drives are well or have had their time."""
        if not self._service.awaited:
            return
        done = all(call.done() for call in self._calls.values())
        if (done and not self._waits()) or monotonic() >= self._deadline:
            self._service.answer(*self._answer())

    def _begin(self) -> Answer | None:
        if self._service.awaited:
            return None
        self._calls, self._parts, self._remarks = {}, {}, []
        for part, resets in self._watch.failed.items():
            if not resets:
                self._remarks.append(f'no rule says what resets {part}')
            called = [one for one in resets if one in self._calls or self._call(one)]
            if called:
                self._parts[part] = called
        self._deadline = monotonic() + self._timeout
        return None if self._calls else self._answer()

    def _call(self, reset: Reset) -> bool:
        """Call a service; return whether it is there."""
        client, request = self._requests.get(reset, (None, None))
        if client is None:
            self._remarks.append(f'no service type {reset.kind}')
        elif not client.service_is_ready():
            self._remarks.append(f'no service {client.service_name}')
        else:
            self._calls[reset] = client.call_async(request)
        return reset in self._calls

    def _waits(self) -> bool:
        """Return whether a drive may become well yet: nothing has refused to reset it."""
        failed = self._watch.failed
        return any(
            part in failed and all(_granted(self._calls[one]) for one in resets)
            for part, resets in self._parts.items()
        )

    def _answer(self) -> Answer:
        """Return whether nothing has failed any more, and what was done."""
        failed, remarks = self._watch.failed, self._remarks
        for reset, call in self._calls.items():
            client, _ = self._requests[reset]
            if not call.done():
                client.remove_pending_request(call)
                remarks.append(f'{client.service_name} has not answered')
            elif not _granted(call):
                said = call.exception() or getattr(call.result(), 'message', '')
                words = clean(str(said)) or 'no reason given'
                remarks.append(f'{client.service_name} refused: {words}')
        well = ', '.join(part for part in self._parts if part not in failed)
        others = ', '.join(part for part in self._parts if part in failed)
        texts = [well and f'reset: {well}', others and f'not well after a reset: {others}']
        message = '; '.join(filter(None, [*texts, *dict.fromkeys(remarks)]))
        return not failed, message or 'no drive has failed'


def _granted(call: Future) -> bool:
    """Return what a service has answered, if it has; many have no word for it."""
    return call.exception() is None and bool(getattr(call.result(), 'success', True))


def _request(source: str, reset: Reset, kind: Any) -> Any:
    """Return a request with the fields of a ``reset``, of the types they have."""
    request = kind.Request()
    for key, value in reset.request:
        place = f'reset.request.{key}'
        if not hasattr(request, key):
            raise MechanismError(source, place, f'{reset.kind} has no such field')
        of: Callable[[Any], Any] = type(getattr(request, key))
        try:
            if of is bool and not isinstance(value, bool):
                raise TypeError
            setattr(request, key, of(value))
            serialize_message(request)
        except Exception:  # of the middleware too, for numbers out of range
            raise MechanismError(source, place, f'{value!r} does not fit it') from None
    return request
