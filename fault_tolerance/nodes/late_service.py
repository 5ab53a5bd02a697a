# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Services whose answer takes longer than their callback."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import Trigger

Answer = tuple[bool, str]
"""Success, and a message that is not empty."""


class LateService:
    """A ``Trigger`` service that may be answered after its callback has returned.

    The EventsExecutor of rclpy knows no coroutines as callbacks, and a callback that waits would
    stop everything else in the node.

    Parameters
    ----------
    node : Node
    name : str
    begin : callable
        Called with every request; returns the answer, or None: then `answer` is called later.

    Attributes
    ----------
    awaited : bool
        Whether anybody waits for an answer.
    """

    def __init__(self, node: Node, name: str, begin: Callable[[], Answer | None]) -> None:
        self._begin = begin
        self._waiting: list[tuple[Trigger.Response, object]] = []
        self._service = node.create_service(Trigger, name, self._on_request)
        # Executors send what the callback returns, finished or not.
        self._send = self._service.send_response
        self._service.send_response = self._send_or_keep

    @property
    def awaited(self) -> bool:
        """Whether anybody waits for an answer."""
        return bool(self._waiting)

    def answer(self, success: bool, message: str) -> None:
        """Answer everybody who waits, with ``success`` and ``message``."""
        waiting, self._waiting = self._waiting, []
        for response, header in waiting:
            response.success, response.message = success, message
            self._send(response, header)

    def _on_request(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        answer = self._begin()
        if answer is not None:
            response.success, response.message = answer
        return response

    def _send_or_keep(self, response: Trigger.Response, header: object) -> None:
        if response.message:
            self._send(response, header)
        else:
            self._waiting.append((response, header))
