# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""A pip installation and a checkout find their own files and start."""

import json
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

WHERE = """
import json
import fault_tolerance
from fault_tolerance.drive_rules.rule_files import rules_named, shipped_rules
from fault_tolerance.mechanism.catalogue import gallery_names, mechanism_named, shipped_names
from fault_tolerance.resources import share_directory
print(json.dumps({
    'code': fault_tolerance.__file__,
    'share': str(share_directory()),
    'config': sorted(file.name for file in (share_directory() / 'config').iterdir()),
    'security': sorted(file.name for file in (share_directory() / 'security').iterdir()),
    'launch': sorted(file.name for file in (share_directory() / 'launch').glob('*.launch.py')),
    'mechanisms': {name: len(mechanism_named(name).actuators)
                   for name in (*shipped_names(), *gallery_names())},
    'rules': {name: len(rules_named(name).rules) for name in shipped_rules()},
}))
"""


def where(python, folder, environment):
    """Return what a fresh interpreter, started in a folder, finds of the package."""
    answer = subprocess.run([python, '-c', WHERE], cwd=folder, env=environment, check=False,
                            capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    return json.loads(answer.stdout)


@pytest.fixture(scope='module')
def installed(source, tmp_path_factory):
    """Return a virtual environment with a pip installation from the copy of the checkout.

    The libraries are those of the interpreter under test, lent by a .pth file.
    """
    folder = tmp_path_factory.mktemp('installed') / 'venv'
    venv.create(folder, with_pip=False)
    python = folder / 'bin' / 'python'
    question = 'import sysconfig; print(sysconfig.get_path("purelib"))'
    asked = subprocess.run([python, '-c', question], capture_output=True, text=True, check=True)
    lent = dict.fromkeys(sysconfig.get_path(name) for name in ('purelib', 'platlib'))
    (Path(asked.stdout.strip()) / 'lent.pth').write_text('\n'.join(lent))
    pip = subprocess.run(
        [python, '-m', 'pip', 'install', '--no-deps', '--no-build-isolation', '--no-index',
         '--ignore-installed', '--disable-pip-version-check', source],
        capture_output=True, text=True, check=False)
    assert pip.returncode == 0, pip.stdout + pip.stderr
    return folder


@pytest.mark.slow
def test_pip_installation(installed, tmp_path, environment):
    found = where(installed / 'bin' / 'python', tmp_path, environment)
    assert Path(found['code']).is_relative_to(installed)
    assert Path(found['share']) == installed / 'share' / 'fault_tolerance'
    checkout = where(sys.executable, ROOT, environment)
    assert found['config'] == checkout['config']
    assert found['launch'] == checkout['launch']
    assert found['security'] == checkout['security'] == ['policy.xml', 'test_bench.xml']
    assert found['mechanisms'] == checkout['mechanisms']
    assert found['rules'] == checkout['rules']


@pytest.mark.slow
def test_pip_installation_has_its_commands(installed, tmp_path, environment):
    for script in ('controller', 'fsm_simulator', 'pointing_reference', 'drive_reports'):
        assert (installed / 'bin' / f'fault_tolerance_{script}').is_file()
        # Too general a word for everybody's PATH.
        assert not (installed / 'bin' / script).exists()
    answer = subprocess.run(
        [installed / 'bin' / 'fault_tolerance', 'measures', 'fsm_4_strut', '--json'],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    assert json.loads(answer.stdout)['mobility'] == 3


@pytest.mark.slow
def test_pip_installation_has_every_module(installed):
    """A folder without __init__.py would be left out, and missed only by whoever installs."""
    package, = installed.glob('lib/python3*/site-packages/fault_tolerance')
    there = {str(file.relative_to(package)) for file in package.rglob('*.py')}
    here = {str(file.relative_to(ROOT / 'fault_tolerance'))
            for file in (ROOT / 'fault_tolerance').rglob('*.py')}
    assert there == here


@pytest.mark.slow
def test_pip_installation_is_known_to_ament(installed):
    index = installed / 'share' / 'ament_index' / 'resource_index' / 'packages'
    assert (index / 'fault_tolerance').is_file()
    assert (installed / 'share' / 'fault_tolerance' / 'package.xml').is_file()


def test_checkout(environment):
    found = where(sys.executable, ROOT, environment)
    assert Path(found['code']).is_relative_to(ROOT)
    assert Path(found['share']) == ROOT
    assert 'mirror_4_strut' in found['mechanisms']
    assert 'cia402' in found['rules']


def test_checkout_from_another_folder(tmp_path, environment):
    """Without any installation, as PYTHONPATH alone would have it."""
    path = [str(ROOT), environment.get('PYTHONPATH', '')]
    environment['PYTHONPATH'] = ':'.join(part for part in path if part)
    found = where(sys.executable, tmp_path, environment)
    assert Path(found['share']) == ROOT
