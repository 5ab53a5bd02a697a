# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""What the documents say: equations that exist, links that lead somewhere, commands that print."""

import json
import os
import re
import shlex
import subprocess
import sys
from fnmatch import fnmatch
from itertools import chain
from pathlib import Path

import pytest

from fault_tolerance.cli import main
from fault_tolerance.design.specification import specification_from_file
from fault_tolerance.mechanism.files import mechanism_from_text

ROOT = Path(__file__).parents[2]
THEORY = (ROOT / 'docs' / 'theory.md').read_text(encoding='utf-8')
DOCUMENTS = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
SOURCES = sorted((ROOT / 'fault_tolerance').rglob('*.py'))
PAPERS_EQUATIONS = range(1, 17)

by_name = {'ids': lambda path: path.name}


def numbers(text):
    """Return the numbers in, for example, ``5-7`` or ``1, 3``."""
    found = []
    for first, last in re.findall(r'(\d+)(?:-(\d+))?', text):
        found += range(int(first), int(last or first) + 1)
    return found


# Equations

def tags():
    return [int(tag) for tag in re.findall(r'\\tag\{(\d+)\}', THEORY)]


def test_equations_are_numbered_in_order():
    assert tags() == list(range(1, len(tags()) + 1))


def citations(path):
    """Return the numbers cited in a source: of the theory, and (in parentheses) of the paper."""
    text = path.read_text(encoding='utf-8')
    ours = re.findall(r'\beqs?\.\s+(\d[\d, -]*)', text)
    papers = re.findall(r'\beqs?\.\s+((?:\(\d+\)(?:, |,\s| and )?)+)', text)
    return [n for group in ours for n in numbers(group)], [
        n for group in papers for n in numbers(group)]


def test_cited_equations_exist():
    there = set(tags())
    for path in SOURCES:
        ours, papers = citations(path)
        assert set(ours) <= there, path
        assert set(papers) <= set(PAPERS_EQUATIONS), path


def test_the_code_cites_what_it_computes():
    ours, papers = zip(*map(citations, SOURCES), strict=True)
    assert {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 13, 14, 15, 16, 20, 21, 22} <= {*chain(*ours)}
    assert {6, 7, 9, 11, 12, 14} <= {*chain(*papers)}


def test_cited_sections_exist():
    sections = set(re.findall(r'^## (\d+)\.', THEORY, re.MULTILINE))
    for path in (*SOURCES, *DOCUMENTS):
        cited = re.findall(
            r'theory(?:\.md)?\)?,\s+section\s+(\d+)', path.read_text(encoding='utf-8'))
        assert set(cited) <= sections, path


def test_documents_named_in_the_code_exist():
    for path in SOURCES:
        for name in re.findall(r'\bdocs/[\w/]+\.\w+', path.read_text(encoding='utf-8')):
            assert (ROOT / name).is_file(), f'{path}: {name}'


# Links

def without_code(text):
    return re.sub(r'`[^`\n]*`', '', re.sub(r'```.*?```', '', text, flags=re.DOTALL))


def anchors(path):
    """Return the anchors that headings of a Markdown file make."""
    text = re.sub(r'```.*?```', '', path.read_text(encoding='utf-8'), flags=re.DOTALL)
    return {
        re.sub(r'[^\w\- ]', '', heading.lower()).strip().replace(' ', '-')
        for heading in re.findall(r'^#+ (.+)$', text, re.MULTILINE)
    }


@pytest.mark.parametrize('path', DOCUMENTS, **by_name)
def test_links_lead_somewhere(path):
    links = re.findall(r'\]\(([^)\s]+)\)', without_code(path.read_text(encoding='utf-8')))
    assert links or path.name in ('conventions.md',)
    for link in links:
        if re.match(r'[a-z]+:', link):
            assert link.startswith('https://'), link
            continue
        target, _, anchor = link.partition('#')
        file = (path.parent / target).resolve() if target else path
        assert file.exists(), link
        assert ROOT in file.parents, link
        if anchor:
            assert anchor in anchors(file), link


@pytest.mark.parametrize('path', DOCUMENTS, **by_name)
def test_files_named_in_the_text_exist(path):
    for name in re.findall(
        r'`((?:docs|config|examples|test|launch)/[\w/.]+\.\w+)`',
        path.read_text(encoding='utf-8'),
    ):
        assert (ROOT / name).is_file(), name


# Code

def blocks(path, language):
    return re.findall(
        rf'^```{language}\n(.*?)^```', path.read_text(encoding='utf-8'), re.DOTALL | re.MULTILINE)


def python(*arguments, folder):
    found = subprocess.run(
        [sys.executable, *arguments], cwd=folder, text=True, capture_output=True, check=False,
        env={**os.environ, 'PYTHONPATH': str(ROOT), 'COLUMNS': '80'})
    assert (found.returncode, found.stderr) == (0, '')
    return found.stdout


def lines_of(text):
    """Return the lines without what nobody sees: blank ones and blanks at the end."""
    return [line.rstrip() for line in text.splitlines() if line.strip()]


def sessions(path):
    """Yield the commands of this package shown in a document, with what they print there."""
    for block in blocks(path, 'console'):
        for command, printed in re.findall(r'^\$ (.*)\n((?:(?!\$ ).*\n)*)', block, re.MULTILINE):
            if command.startswith('python -m fault_tolerance '):
                yield shlex.split(command)[3:], lines_of(printed)


def same(printed, shown):
    """Tell whether the lines are those shown, where ``...`` stands for any number of them."""
    wanted = '\n'.join(shown).replace('[', '[[]')
    return fnmatch('\n'.join(printed), wanted.replace('\n...', '\n*').replace('...\n', '*\n'))


@pytest.mark.parametrize('path', DOCUMENTS, **by_name)
def test_commands_print_what_is_shown(path, tmp_path, monkeypatch, capsys):
    """In this process: `test_cli.py` has it as a program."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('COLUMNS', '80')
    for text in (*blocks(path, 'yaml'), *blocks(path, 'csv')):
        name = re.match(r'# (\S+\.(?:yaml|csv))\n', text)
        if name:
            (tmp_path / name.group(1)).write_text(text, encoding='utf-8')
    for command, shown in sessions(path):
        code = main(command)
        found = capsys.readouterr()
        assert (code, found.err) == (0, ''), command
        printed = lines_of(found.out)
        assert same(printed, shown), '\n'.join([shlex.join(command), *printed])


@pytest.mark.parametrize('path', DOCUMENTS, **by_name)
def test_mechanisms_in_the_text_can_be_used(path):
    for text in blocks(path, 'yaml'):
        if re.search(r'^mechanism:', text, re.MULTILINE) and not text.startswith('design:'):
            assert mechanism_from_text(text).actuators


def test_the_specification_in_the_text_can_be_used(tmp_path):
    text, = blocks(ROOT / 'docs' / 'design.md', 'yaml')
    (tmp_path / 'design.yaml').write_text(text, encoding='utf-8')
    found = specification_from_file(tmp_path / 'design.yaml')
    assert found.mechanism(found.start).actuators


@pytest.mark.parametrize('path', DOCUMENTS, **by_name)
def test_python_in_the_text_runs(path, tmp_path):
    for text in blocks(path, 'python'):
        python('-c', text, folder=tmp_path)


def test_adapting_shows_commands():
    assert len(list(sessions(ROOT / 'docs' / 'adapting.md'))) >= 3


# Keys

def listed_keys(heading):
    """Return the keys in the first column of the table under a heading."""
    text = (ROOT / 'docs' / 'command_line.md').read_text(encoding='utf-8')
    section = text.split(f'## `{heading}`')[1].split('\n## ')[0]
    rows = re.findall(r'^\| (`.*?) \|', section, re.MULTILINE)
    return {key for row in rows for key in re.findall(r'`(\w+)`', row)}


@pytest.mark.parametrize(('heading', 'options'), [
    ('measures --json', ['measures', 'fsm_4_strut', '--pairs']),
    ('check --json', ['check', 'fsm_4_strut']),
])
def test_every_key_is_explained(capsys, heading, options):
    assert main([*options, '--json']) == 0
    assert listed_keys(heading) == set(json.loads(capsys.readouterr().out))
