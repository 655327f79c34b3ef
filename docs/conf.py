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
"""How Sphinx builds the documentation; ``make docs`` calls it."""

import ast
from dataclasses import fields
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

project = 'kachaka_simple_control'
author = copyright = 'kachaka_simple_control contributors'  # noqa: A001
# setup.py has the only copy of the version, and need not be run to be read.
release = version = next(
    ast.literal_eval(node.value) for node in ast.walk(ast.parse((ROOT / 'setup.py').read_text()))
    if isinstance(node, ast.keyword) and node.arg == 'version')

extensions = [
    'myst_parser',
    'sphinx.ext.autodoc',
    'sphinx.ext.autosummary',
    'sphinx_copybutton',
]
exclude_patterns = ['_build', 'reference/generated/parameters.md']
templates_path = ['_templates']

# Markdown
myst_enable_extensions = ['attrs_inline', 'colon_fence', 'deflist']
myst_heading_anchors = 3

# The reference, from the docstrings
autosummary_generate = True
autosummary_ignore_module_all = False
autodoc_member_order = 'bysource'
autodoc_typehints = 'signature'
autodoc_typehints_format = 'short'
autodoc_preserve_defaults = True
add_module_names = False
python_use_unqualified_type_names = True
toc_object_entries_show_parents = 'hide'
# What others document elsewhere, and what is not public.
nitpick_ignore_regex = [
    (r'py:.*', r'(rclpy|geometry_msgs|nav_msgs|std_srvs|builtin_interfaces|rcl_interfaces)\..*'),
    (r'py:.*', r'(argparse|collections|concurrent|enum|numbers|signal|socket|subprocess)\..*'),
    (r'py:.*', r'(abc|contextlib|datetime|io|threading|types|typing|asyncio|os|pathlib)\..*'),
    (r'py:.*', r'(decimal|re|diagnostic_msgs|kachaka_api|kachaka_api_pb2|rich)\..*'),
    (r'py:.*', r'(kachaka_simple_control\.([a-z_]+\.)+[A-Za-z]*T|dict\[str.*)'),
    (r'py:class', r'(Axes|Figure|Point|kachaka_simple_control\.files\.yaml_document\.Node)'),
    (r'py:class', r'(Event|FieldKind|PathPart)'),  # names of types, for older releases
    (r'py:.*', r'(Any|Callable|Enum|Exception|NoReturn|RuntimeError|ValueError|SystemExit)'),
    (r'py:.*', r'(Field|Footprint|FrameType|Iterator|Path|Sequence|TracebackType)'),
    # The lines are described by their schema; the numbers are ranges of theirs.
    (r'py:class', r'(kachaka_simple_control\.files\.protocol\..*|[0-9.]+)'),
    (r'py:exc', 'ExternalShutdownException'),
    (r'py:class', r'(Executor|Node|Publisher|Time|Twist|Context|Protocol)'),
    (r'py:class', r'(DiagnosticArray|Odometry)'),
    (r'py:class', r'(bool|bytes|dict|float|int|list|None|object|str|tuple|type|BaseException)'),
]

# A command can be copied without what it prints.
copybutton_exclude = '.linenos, .gp, .go'

# The site
html_theme = 'furo'
html_title = project
html_show_copyright = False
html_theme_options = {
    'top_of_page_buttons': [],
    'light_css_variables': {
        'color-brand-primary': '#0b6b5c', 'color-brand-content': '#0b6b5c'},
    'dark_css_variables': {
        'color-brand-primary': '#5fd3bd', 'color-brand-content': '#5fd3bd'},
}
html_static_path = ['_static']
html_css_files = ['site.css']

# make docs DOCS=linkcheck
linkcheck_anchors = False


def setup(app):
    """
    Add to the build what Sphinx does not do.

    :param app: Sphinx
    """
    write_parameters()
    app.connect('autodoc-process-docstring', escape_bars)
    app.connect('html-page-context', collapse_navigation, priority=400)  # before Furo


def write_parameters():
    """Write the table of the node's parameters, from the one place that declares them."""
    from kachaka_simple_control.ros.node_parameters import NodeParameters
    rows = ['| parameter | default | range | what it is |', '|---|---|---|---|']
    for field in fields(NodeParameters):
        bounds = field.metadata['range']
        span = f'{bounds[0]:g} to {bounds[1]:g}' if bounds else ''
        description = field.metadata['description']
        rows.append(f'| `{field.name}` | `{field.default}` | {span} | {description} |')
    generated = Path(__file__).parent / 'reference' / 'generated'
    generated.mkdir(exist_ok=True)
    generated.joinpath('parameters.md').write_text('\n'.join(rows) + '\n')


def escape_bars(app, what, name, obj, options, lines):  # noqa: ARG001
    """
    Let bars in docstrings be magnitudes, as in formulas; reST would take them for substitutions.

    :param lines: the docstring, changed in place
    """
    lines[:] = [line.replace('|', '\\|') if '``' not in line else line for line in lines]


def collapse_navigation(app, pagename, templatename, context, doctree):  # noqa: ARG001
    """Let a page's sidebar expand its own branch alone: all branches take half of the build."""
    toctree = context['toctree']
    context['toctree'] = lambda **options: toctree(**{**options, 'collapse': True})
