"""Prints what a launch file would start: `resolve_launch.py FILE [ARGUMENT:=VALUE]...`, in Python, XML or YAML.

ROS's launch is on no package index. What stands here for it knows the words that our files use, as launch and launch_ros
from Humble on define them, and refuses every other one: an attribute, a keyword or a substitution that ROS has not is an
error. One JSON object on standard output: `arguments` with name, description and choices; `command`, as launch_ros puts it
together.
"""

import json
import os
import re
import shlex
import sys
import types
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import yaml


class LaunchConfiguration:
    def __init__(self, variable_name):
        self.name = variable_name

    def perform(self, values):
        return values[self.name]


class FindPackage:
    def __init__(self, package):
        self.package = package

    def prefix(self):
        for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
            if Path(prefix, 'share/ament_index/resource_index/packages', self.package).is_file():
                return Path(prefix)
        raise LookupError(f'package {self.package!r} is in no prefix of AMENT_PREFIX_PATH')


class FindPackageShare(FindPackage):
    def perform(self, _values):
        return str(self.prefix() / 'share' / self.package)


class ExecutableInPackage(FindPackage):
    def __init__(self, executable, package):
        super().__init__(package)
        self.executable = executable

    def perform(self, _values):
        path = self.prefix() / 'lib' / self.package / self.executable
        if not os.access(path, os.X_OK):
            raise LookupError(f'{path} is no executable')
        return str(path)


class PathJoinSubstitution:
    def __init__(self, substitutions):
        self.parts = substitutions

    def perform(self, values):
        return os.path.join(*(perform(part, values) for part in self.parts))


class DeclareLaunchArgument:
    def __init__(self, name, *, default_value=None, description=None, choices=None):
        self.name, self.default_value = name, default_value
        self.description, self.choices = description, choices

    def declare(self, values):
        if self.name not in values:
            values[self.name] = perform(self.default_value, values)
        if self.choices is not None and values[self.name] not in self.choices:
            raise ValueError(f'{self.name}:={values[self.name]} is none of {self.choices}')


class Node:
    def __init__(self, *, executable, name, namespace, arguments, parameters, remappings, output):
        self.executable, self.name, self.namespace = executable, name, namespace
        self.arguments, self.parameters, self.remappings = arguments, parameters, remappings
        if output not in ('screen', 'log', 'both', 'own_log', 'full'):
            raise ValueError(f'output={output}')

    def command(self, values):
        command = [perform(part, values) for part in (self.executable, *self.arguments)]
        command += ['--ros-args', '-r', '__node:=' + perform(self.name, values)]
        command += ['-r', '__ns:=/' + perform(self.namespace, values).strip('/')]
        for file in self.parameters:
            # launch_ros leaves a missing file out, with a warning.
            if not Path(perform(file, values)).is_file():
                raise LookupError(f'no parameter file {perform(file, values)}')
            command += ['--params-file', perform(file, values)]
        for source, target in self.remappings:
            command += ['-r', f'{perform(source, values)}:={perform(target, values)}']
        return command


def perform(value, values):
    """A text, a substitution, or a list of both, joined."""
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        return ''.join(perform(part, values) for part in value)
    return value.perform(values)


SUBSTITUTIONS = {
    'var': LaunchConfiguration,
    'find-pkg-share': FindPackageShare,
    'exec-in-pkg': ExecutableInPackage,
}


def substituted(text):
    """`$(name argument...)` in a text of XML or YAML."""
    parts = []
    for part in re.split(r'(\$\([^()]*\))', text):
        if part.startswith('$('):
            name, *arguments = part[2:-1].split()
            parts.append(SUBSTITUTIONS[name](*arguments))
        elif '$' in part:
            raise ValueError(f'{text!r}: what stands behind $ is not understood')
        elif part:
            parts.append(part)
    return parts


def attributes(entity, required, optional=()):
    """The values of an entity that has all of `required`, perhaps some of `optional`, and nothing else."""
    missing, unknown = set(required) - set(entity), set(entity) - set(required) - set(optional)
    if missing or unknown:
        raise ValueError(f'{entity}: missing {missing or "nothing"}, unknown {unknown or "nothing"}')
    return [entity.get(key) for key in (*required, *optional)]


def declared(entity):
    name, default, description, choices = attributes(
        entity, ['name', 'default', 'description'], ['choice'])
    if choices is not None:
        choices = [attributes(choice, ['value'])[0] for choice in choices]
    return DeclareLaunchArgument(
        name, default_value=substituted(default), description=description, choices=choices)


def node(entity):
    executable, name, namespace, args, output, params, remaps = attributes(
        entity, ['exec', 'name', 'namespace', 'args', 'output', 'param', 'remap'])
    # launch splits at spaces outside of substitutions.
    words = shlex.split(re.sub(r'\$\([^()]*\)', lambda found: shlex.quote(found[0]), args))
    return Node(
        executable=substituted(executable),
        name=substituted(name),
        namespace=substituted(namespace),
        arguments=[substituted(word) for word in words],
        parameters=[substituted(attributes(param, ['from'])[0]) for param in params],
        remappings=[map(substituted, attributes(remap, ['from', 'to'])) for remap in remaps],
        output=output)


def from_entities(entities):
    """The actions of XML or YAML, given as (kind, attributes)."""
    return [{'arg': declared, 'node': node}[kind](entity) for kind, entity in entities]


def from_xml(path):
    root = ElementTree.parse(path).getroot()
    if root.tag != 'launch' or root.attrib:
        raise ValueError(f'{path}: the root is <{root.tag}>')

    def entity(element):
        out = dict(element.attrib)
        for child in element:
            out.setdefault(child.tag, []).append(entity(child))
        return out

    return from_entities((child.tag, entity(child)) for child in root)


def from_yaml(path):
    document = yaml.safe_load(path.read_text())
    (entities,) = attributes(document, ['launch'])
    return from_entities(one for entity in entities for one in entity.items())


def from_python(path):
    modules = {
        'launch': {'LaunchDescription': list},
        'launch.actions': {'DeclareLaunchArgument': DeclareLaunchArgument},
        'launch.substitutions': {
            'LaunchConfiguration': LaunchConfiguration,
            'PathJoinSubstitution': PathJoinSubstitution,
        },
        'launch_ros': {},
        'launch_ros.actions': {'Node': Node},
        'launch_ros.substitutions': {
            'ExecutableInPackage': ExecutableInPackage,
            'FindPackageShare': FindPackageShare,
        },
    }
    for name, content in modules.items():
        sys.modules[name] = types.ModuleType(name)
        vars(sys.modules[name]).update(content)
    scope = {}
    exec(compile(path.read_text(), str(path), 'exec'), scope)
    return scope['generate_launch_description']()


def main(path, *assignments):
    path = Path(path)
    values = dict(assignment.split(':=', 1) for assignment in assignments)
    actions = {'.py': from_python, '.xml': from_xml, '.yaml': from_yaml}[path.suffix](path)
    arguments = [action for action in actions if isinstance(action, DeclareLaunchArgument)]
    unknown = set(values) - {argument.name for argument in arguments}
    if unknown:
        raise ValueError(f'{path.name} takes no argument {unknown}')
    for argument in arguments:
        argument.declare(values)
    (started,) = (action for action in actions if isinstance(action, Node))
    print(json.dumps({
        'arguments': [[argument.name, argument.description, argument.choices] for argument in arguments],
        'command': started.command(values),
    }))


main(*sys.argv[1:])
