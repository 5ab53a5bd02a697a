# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The shared files are found however the package came onto the machine."""

import sys
from pathlib import Path

import pytest

from fault_tolerance import resources

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def lonely(tmp_path, monkeypatch):
    """Pretend that the code lies in a place with no shared files near it."""
    folder = tmp_path / 'prefix' / 'lib' / 'python3' / 'site-packages' / 'fault_tolerance'
    folder.mkdir(parents=True)
    monkeypatch.setattr(resources, '__file__', str(folder / 'resources.py'))
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'interpreter'))
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    return folder


def filled(share):
    (share / 'config' / 'mechanisms').mkdir(parents=True)
    return share


def test_checkout():
    assert (resources.share_directory() / 'config' / 'mechanisms').is_dir()


def test_nothing_found_names_the_places(lonely, tmp_path, monkeypatch):
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'overlay'))
    with pytest.raises(FileNotFoundError, match='config/mechanisms') as caught:
        resources.share_directory()
    for place in ('prefix', 'interpreter', 'overlay'):
        assert str(tmp_path / place / 'share' / 'fault_tolerance') in str(caught.value)


@pytest.mark.parametrize('place', ['prefix', 'interpreter', 'prefix/lib/python3/site-packages'])
def test_installation(lonely, tmp_path, place):
    share = filled(tmp_path / place / 'share' / 'fault_tolerance')
    assert resources.share_directory() == share


def test_ament_prefixes_in_their_order(lonely, tmp_path, monkeypatch):
    share = filled(tmp_path / 'underlay' / 'share' / 'fault_tolerance')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "overlay"}::{tmp_path / "underlay"}')
    assert resources.share_directory() == share


def test_own_installation_comes_before_the_environment(lonely, tmp_path, monkeypatch):
    own = filled(tmp_path / 'prefix' / 'share' / 'fault_tolerance')
    filled(tmp_path / 'other' / 'share' / 'fault_tolerance')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'other'))
    assert resources.share_directory() == own


def test_folder_without_mechanisms_is_passed_over(lonely, tmp_path, monkeypatch):
    (tmp_path / 'prefix' / 'share' / 'fault_tolerance' / 'config').mkdir(parents=True)
    share = filled(tmp_path / 'interpreter' / 'share' / 'fault_tolerance')
    assert resources.share_directory() == share
