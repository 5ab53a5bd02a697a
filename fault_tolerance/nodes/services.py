# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's services: clear failures, pause, resume."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from fault_tolerance.control.notices import Notice, clean
from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.nodes.health import Health
from fault_tolerance.nodes.late_service import Answer, LateService
from fault_tolerance.nodes.timeline import TimeLine

RESETTING = 'drives are reset'
"""Why it holds until a reset is over: a drive that wakes up must not be in anybody's way."""

SETTLING = 1.0
"""Seconds for which drives that are reset may be reported as failed still."""


class OperatorServices:
    """Offers ``~/clear_failures`` and ``~/pause``.

    Where the parameter ``reset_service`` names a service, it is called before failures are
    cleared. Meanwhile everything holds, and goes on in the order in which messages come.

    Parameters
    ----------
    node : Node
    supervisor : Supervisor
    timeline : TimeLine
    health : Health
        Tells of resets that fail.
    values : dict
        The parameters of the node by name, as they are at any time.
    done : callable
        Called after either and before the response, to publish a command at once.
    forget : callable
        Called before failures are cleared; returns those that are still seen.
    """

    def __init__(
        self, node: Node, supervisor: Supervisor, timeline: TimeLine, health: Health,
        values: dict[str, Any], done: Callable[[], None], forget: Callable[[], Sequence[str]],
    ) -> None:
        self._supervisor, self._timeline = supervisor, timeline
        self._health, self._values = health, values
        self._done, self._forget = done, forget
        name = values['reset_service']
        self._reset = node.create_client(Trigger, name) if name else None
        self._call: Future | None = None
        self._deadline = 0.0
        self._clears = LateService(node, '~/clear_failures', self._begin)
        node.create_service(SetBool, '~/pause', self._pause)

    def look(self) -> None:
        """Clear, and answer, if the reset that is waited for is over."""
        now = self._timeline.now()
        if self._call is not None and (words := self._outcome(self._call, now)):
            self._call = None
            self._supervisor.pause(False, now, RESETTING)
            success, message = self._clear()
            self._clears.answer(success, f'{words}; {message}')

    def _begin(self) -> Answer | None:
        """Take a request to clear; return the answer, or None while drives are reset."""
        if self._call is not None:
            return None
        if self._reset is None:
            return self._clear()
        if not self._reset.service_is_ready():
            success, message = self._clear()
            return success, f'{self._warned(f"no service {self._reset.service_name}")}; {message}'
        now = self._timeline.now()
        self._deadline = now + self._values['reset_timeout']
        self._call = self._reset.call_async(Trigger.Request())
        self._supervisor.pause(True, now, RESETTING)
        self._done()
        return None

    def _outcome(self, call: Future, now: float) -> str:
        """Return how the reset has ended, in words; empty while it has not."""
        assert self._reset is not None
        name = self._reset.service_name
        if not call.done():
            if now < self._deadline:
                return ''
            self._reset.remove_pending_request(call)
            return self._warned(f'{name} has not answered')
        if call.exception() is not None:
            return self._warned(f'{name} failed: {clean(str(call.exception()))}')
        words = clean(call.result().message) or f'{name} has answered'
        if not call.result().success:
            return self._warned(words)
        # Its answer and what the drives say are on different ways.
        self._deadline = min(self._deadline, now + SETTLING)
        if now < self._deadline and self._supervisor.still_reported(now):
            return ''
        return words

    def _warned(self, text: str) -> str:
        self._health.warn(Notice('reset', f'reset: {text}', rejected=False))
        return text

    def _clear(self) -> Answer:
        outcome = self._supervisor.clear(self._timeline.now(), self._forget())
        self._done()
        return outcome.success, outcome.message

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._supervisor.pause(request.data, self._timeline.now())
        self._done()
        response.success, response.message = True, self._supervisor.output.state.value
        return response
