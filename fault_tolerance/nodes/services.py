# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The controller's services: clear failures, pause, resume."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from fault_tolerance.control.supervisor import Supervisor
from fault_tolerance.nodes.timeline import TimeLine


class OperatorServices:
    """Offers ``~/clear_failures`` and ``~/pause``.

    ``done`` is called after either and before the response, to publish a command at once;
    ``cleared`` after the failures have been cleared, before that.
    """

    def __init__(
        self, node: Node, supervisor: Supervisor, timeline: TimeLine, done: Callable[[], None],
        cleared: Callable[[], None],
    ) -> None:
        self._supervisor = supervisor
        self._timeline = timeline
        self._done, self._cleared = done, cleared
        node.create_service(Trigger, '~/clear_failures', self._clear)
        node.create_service(SetBool, '~/pause', self._pause)

    def _clear(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        outcome = self._supervisor.clear(self._timeline.now())
        self._cleared()
        self._done()
        response.success, response.message = outcome.success, outcome.message
        return response

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._supervisor.pause(request.data, self._timeline.now())
        self._done()
        response.success, response.message = True, self._supervisor.output.state.value
        return response
