# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The names, types and qualities of service that users and other tools rely on."""

from __future__ import annotations

from math import dist, hypot

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_rig import CALM, LATCHED, Probe, values_of
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_msgs.msg import Float64, Float64MultiArray, String
from visualization_msgs.msg import Marker, MarkerArray

from fault_tolerance.analysis.topics import RECORDED

RELIABLE, SENSOR = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
SCALARS = (
    'position_tolerance', 'torque_tolerance', 'hard_tolerance', 'retained_manipulability',
    'condition_number', 'active_failures', 'reconfiguration_time', 'tracking_error',
    'time_since_report', 'internal_force',
)
ARRAYS = ('position_measures', 'torque_measures', 'hard_measures')
PUBLISHED = {
    'velocity_controller/commands': (
        'fault_tolerance', 'std_msgs/msg/Float64MultiArray', RELIABLE
    ),
    'fault_tolerance/joint_commands': (
        'fault_tolerance', 'sensor_msgs/msg/JointState', RELIABLE
    ),
    'fault_tolerance/state': ('fault_tolerance', 'std_msgs/msg/String', RELIABLE),
    'fault_tolerance/status': (
        'fault_tolerance', 'diagnostic_msgs/msg/DiagnosticStatus', RELIABLE
    ),
    'fault_tolerance/metrics': (
        'fault_tolerance', 'diagnostic_msgs/msg/DiagnosticArray', RELIABLE
    ),
    **{
        f'fault_tolerance/metrics/{name}': ('fault_tolerance', 'std_msgs/msg/Float64', RELIABLE)
        for name in SCALARS
    },
    **{
        f'fault_tolerance/metrics/{name}': (
            'fault_tolerance', 'std_msgs/msg/Float64MultiArray', RELIABLE
        )
        for name in ARRAYS
    },
    'fault_tolerance/achieved_velocity': (
        'fault_tolerance', 'geometry_msgs/msg/TwistStamped', RELIABLE
    ),
    'fault_tolerance/platform_pose': (
        'fault_tolerance', 'geometry_msgs/msg/PoseStamped', RELIABLE
    ),
    'fault_tolerance/markers': (
        'fault_tolerance', 'visualization_msgs/msg/MarkerArray', RELIABLE
    ),
    'joint_states': ('fsm', 'sensor_msgs/msg/JointState', SENSOR),
    'fsm/mirror_pose': ('fsm', 'geometry_msgs/msg/PoseStamped', SENSOR),
    'fsm/mirror_velocity': ('fsm', 'geometry_msgs/msg/TwistStamped', SENSOR),
    'fsm/markers': ('fsm', 'visualization_msgs/msg/MarkerArray', RELIABLE),
    'fault_tolerance/task_velocity': ('pointing', 'geometry_msgs/msg/TwistStamped', RELIABLE),
    'pointing/error': ('pointing', 'geometry_msgs/msg/Vector3Stamped', RELIABLE),
    'pointing/reference': ('pointing', 'geometry_msgs/msg/Vector3Stamped', RELIABLE),
}
SUBSCRIBED = {
    'joint_states': ('fault_tolerance', SENSOR),
    'fault_tolerance/task_velocity': ('fault_tolerance', RELIABLE),
    'velocity_controller/commands': ('fsm', RELIABLE),
    'fsm/inject_fault': ('fsm', RELIABLE),
    'fsm/mirror_pose': ('pointing', SENSOR),
    'pointing/reference': ('fsm', SENSOR),
    'fault_tolerance/status': ('fsm', RELIABLE),
}
SERVICES = {
    'fault_tolerance/clear_failures': 'std_srvs/srv/Trigger',
    'fault_tolerance/pause': 'std_srvs/srv/SetBool',
    'fault_tolerance/probe': 'std_srvs/srv/Trigger',
}


@pytest.fixture(params=['', 'robot'], scope='module')
def namespace(request):
    return request.param


def is_known(node, root):
    """Tell whether discovery is complete; an end point may come before the name of its node."""
    publishers = [node.get_publishers_info_by_topic(root + topic) for topic in PUBLISHED]
    subscriptions = [node.get_subscriptions_info_by_topic(root + topic) for topic in SUBSCRIBED]
    diagnostics = node.get_publishers_info_by_topic('/diagnostics')
    listeners = node.get_subscriptions_info_by_topic('/diagnostics')
    groups = [*publishers, *subscriptions, diagnostics, listeners]
    services = dict(node.get_service_names_and_types())
    return (
        all(groups)
        and len({info.node_name for info in diagnostics}) == 3
        and all('UNKNOWN' not in info.node_name for group in groups for info in group)
        and all(root + service in services for service in SERVICES)
    )


@pytest.fixture(scope='module')
def running(start_for_module, ros, namespace):
    """All three nodes of the demonstration, and a probe that has heard of them."""
    processes = [
        start_for_module(module, namespace, mechanism='mirror_4_strut', **parameters)
        for module, parameters in (
            ('fsm_simulator', {'rate': CALM}), ('controller', {}), ('pointing_reference', {}))
    ]
    probe = Probe(namespace)
    root = f'/{namespace}/' if namespace else '/'
    probe.wait(lambda: is_known(probe.node, root), 'every end point and its node')
    probe.wait_for_state('nominal')
    probe.wait(lambda: probe.metrics and len(probe.commands) > 10, 'metrics and commands')
    yield probe
    probe.close()
    for process in processes:
        process.end()


def test_everything_is_where_the_contract_says(running, namespace):
    root = f'/{namespace}/' if namespace else '/'
    node = running.node
    for topic, (publisher, kind, reliability) in PUBLISHED.items():
        (info,) = node.get_publishers_info_by_topic(root + topic)
        assert (info.node_name, info.topic_type) == (publisher, kind), topic
        assert info.node_namespace == (root.rstrip('/') or '/')
        assert info.qos_profile.reliability == reliability, topic
        latched = info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert latched is topic.endswith(('/state', '/status')), topic
    for topic, (subscriber, reliability) in SUBSCRIBED.items():
        infos = node.get_subscriptions_info_by_topic(root + topic)
        (info,) = [one for one in infos if one.node_name == subscriber]
        assert info.qos_profile.reliability == reliability, topic
    publishers = node.get_publishers_info_by_topic('/diagnostics')
    assert {info.node_name for info in publishers} == {'fault_tolerance', 'fsm', 'pointing'}
    (info,) = node.get_subscriptions_info_by_topic('/diagnostics')
    assert info.node_name == 'fault_tolerance'
    services = dict(node.get_service_names_and_types())
    for service, kind in SERVICES.items():
        assert services[root + service] == [kind]
    assert running.clear().message == 'nothing to release; now nominal'


def test_the_metrics_say_all_there_is_to_say(running, namespace):
    prefix = f'{namespace}/' if namespace else ''
    # What went wrong while the nodes started is told of for some seconds.
    calm = DiagnosticStatus.OK
    running.wait(lambda: running.metrics[-1].status[0].level == calm, 'a level of OK')
    mechanism, *parts = running.metrics[-1].status
    assert mechanism.name == 'fault_tolerance: mechanism'
    assert mechanism.message.startswith('nominal: ')
    assert set(values_of(mechanism)) == {
        'state', 'failures', 'mobility', 'lost', 'gained', 'retained_manipulability',
        'position_measure', 'torque_measure', 'hard_measure', 'smallest_singular_value',
        'condition_number', 'saturation', 'flexure_strain', 'recovery_time_us', 'worst_next',
        'report_stamp', 'residual', 'misfit', 'scale', 'secondary_scale', 'major_jump',
        'rate_jump', 'out_of_range', 'sensorless', 'inconsistent', 'suspected',
        'worst_next_suspected', 'not_told_apart', 'undetectable', 'latent_since_probe',
        'internal_force', 'time_since_report', 'conversion', 'tracking_error', 'groups',
    }
    names = [f'{kind}_{number}' for kind in ('theta', 'strut') for number in range(1, 5)]
    assert [part.hardware_id for part in parts] == [prefix + name for name in names]
    for part in parts[:4]:
        values = values_of(part)
        assert values['failure'] == 'none'
        assert float(values['position']) == pytest.approx(3**-0.5, abs=1e-3)
        assert float(values['torque']) == pytest.approx(0.5, abs=1e-3)
        assert float(values['position_optimality']) == pytest.approx(1.0, abs=1e-2)
        assert float(values['torque_optimality']) == pytest.approx(1.0, abs=1e-2)
    for part in parts[4:]:
        assert float(values_of(part)['hard']) == pytest.approx(0.5, abs=1e-3)


def test_plots_have_topics_and_labels_of_their_own(running):
    scalars = {
        name: running.heard(Float64, f'fault_tolerance/metrics/{name}') for name in SCALARS
    }
    lists = {
        name: running.heard(Float64MultiArray, f'fault_tolerance/metrics/{name}')
        for name in ARRAYS
    }
    # Nothing has been reported: since when is not known.
    assert not scalars.pop('time_since_report')
    heard = [*scalars.values(), *lists.values()]
    running.wait(lambda: all(heard), 'every metric')
    assert scalars['position_tolerance'][-1].data == pytest.approx(3**-0.5, abs=1e-3)
    assert scalars['torque_tolerance'][-1].data == pytest.approx(0.5, abs=1e-3)
    assert scalars['hard_tolerance'][-1].data == pytest.approx(0.5, abs=1e-3)
    assert scalars['retained_manipulability'][-1].data == pytest.approx(1.0)
    assert scalars['active_failures'][-1].data == 0.0
    for name, messages in lists.items():
        kind = 'strut' if name == 'hard_measures' else 'theta'
        (dimension,) = messages[-1].layout.dim
        assert dimension.label == ','.join(f'{kind}_{number}' for number in range(1, 5))
        assert (dimension.size, dimension.stride) == (4, 4)
        assert len(messages[-1].data) == 4


def test_metrics_come_five_times_a_second(running):
    running.metrics.clear()

    def regular():
        # By their stamps: ten periods in a row. A busy machine may delay an end of some of them.
        stamps = [one.header.stamp for one in running.metrics[-11:]]
        times = [stamp.sec + 1e-9 * stamp.nanosec for stamp in (stamps[0], stamps[-1])]
        return len(stamps) == 11 and times[1] - times[0] == pytest.approx(2.0, abs=0.2)

    running.wait(lambda: running.metrics and regular(), 'ten periods of metrics')


def test_every_node_tells_of_its_own_health_with_its_namespace(running, namespace):
    diagnostics = running.heard(DiagnosticArray, '/diagnostics')

    def names():
        return {status.name for message in diagnostics for status in message.status}

    prefix = f'{namespace}/' if namespace else ''
    wanted = {
        f'{prefix}{name}'
        for name in ('fault_tolerance: controller', 'fsm: simulator', 'pointing: reference')
    }
    running.wait(lambda: wanted <= names(), 'the health of all three nodes')


def test_the_state_reaches_those_who_come_late(running):
    late = running.heard(String, 'fault_tolerance/state', LATCHED)
    # Where the machine stalls it holds for a moment.
    running.wait(lambda: late and late[-1].data == 'nominal', 'the state')


def test_what_is_recorded_is_what_is_published():
    """And what the operator says, and all diagnostics."""
    kinds = {topic: kind for topic, (_, kind, _) in PUBLISHED.items()}
    others = {
        'fsm/inject_fault': 'std_msgs/msg/String',
        'operator/phase': 'std_msgs/msg/String',
        '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
        '/rosout': 'rcl_interfaces/msg/Log',
        # Of a mechanism that has brakes, or struts that can be released.
        'fault_tolerance/brake_commands': 'std_msgs/msg/Float64MultiArray',
        'fault_tolerance/release_commands': 'std_msgs/msg/Float64MultiArray',
    }
    assert RECORDED == kinds | others


def test_markers_show_struts_mirror_boresight_and_target(running):
    markers = running.heard(MarkerArray, 'fsm/markers')

    def shown():
        return {one.ns: one for one in markers[-1].markers if one.action == Marker.ADD}

    struts = [f'strut_{n}' for n in (1, 2, 3, 4)]
    running.wait(lambda: markers and 'target' in shown(), 'markers')
    names = [marker.ns for marker in markers[-1].markers]
    assert len(names) == len(set(names))
    assert list(shown()) == [*struts, 'mirror', 'boresight', 'target', 'scale']
    assert {marker.header.frame_id for marker in markers[-1].markers} == {'base_link'}
    assert shown()['scale'].text == 'motion x100'

    # The mirror follows a circle of 1 mrad: shown 100 times as large, the boresight of three
    # characteristic lengths of 20 mm ends on a circle of 6 mm, and at its target.
    def away():
        tip, target = shown()['boresight'].points[1], shown()['target'].pose.position
        return dist((tip.x, tip.y, tip.z), (target.x, target.y, target.z))

    running.wait(lambda: away() < 1e-3, 'the boresight to reach its target')
    tip = shown()['boresight'].points[1]
    assert hypot(tip.x, tip.y) == pytest.approx(6e-3, rel=0.2)

    healthy = shown()['strut_4'].color
    running.node.create_publisher(String, 'fsm/inject_fault', LATCHED).publish(
        String(data='stuck theta_4')
    )
    running.wait_for_state('degraded')
    markers.clear()
    running.wait(lambda: markers, 'new markers')
    assert shown()['strut_4'].color != healthy
    assert shown()['strut_3'].color == healthy
    assert shown()['strut_4/label'].text == 'theta_4 stuck'
    assert 'strut_3/label' not in shown()
