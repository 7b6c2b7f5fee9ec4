"""Writes what the Python package knows of the library's tables and documents.

    python scripts/release/python_types.py reports             prints reports.py
    python scripts/release/python_types.py functions           prints _functions.pyi
    python scripts/release/python_types.py reference FILE      writes signatures and docstrings as JSON, for the site

`python/ventriform/reports.py` has the reports' classes, from the OpenAPI document (DOCUMENT, or
openapi/ventriform.json); `_functions.pyi` the signatures of the functions that take parameters, from the tables of the
installed package. scripts/generate.sh writes both.
"""

import ast
import inspect
import json
import keyword
import os
import pathlib
import sys
import textwrap

ROOT = pathlib.Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python/ventriform"

# The documents that the package returns; what they refer to follows.
DOCUMENTS = [
    "ModelReport",
    "SegmentationReport",
    "BeatReport",
    "ComparisonReport",
    "SerialReport",
    "NormalLimits",
    "PolarMap",
    "Agreement",
    "Job",
    "Volume",
]
# Objects whose fields are the caller's parameters.
OPEN = {
    "ModelParameters",
    "SegmentationParameters",
    "BeatParameters",
    "ComparisonParameters",
    "SerialParameters",
    "NormalsFitParameters",
    "JobParameters",
}
# What the package has another object for.
RENAMED = {"Volume": "StoredVolume", "NormalLimits": "LimitsDocument"}
PLAIN = {"number": "float", "integer": "int", "string": "str", "boolean": "bool", "null": "None"}
PREFIX = "#/components/schemas/"


def flat(schema):
    """A schema with the properties of those that it is made of."""
    parts = [SCHEMAS[of["$ref"].removeprefix(PREFIX)] if "$ref" in of else of for of in schema.get("allOf", [])]
    made = {"properties": {}, "required": []} if parts else {}
    for part in map(flat, parts):
        made["properties"] |= part.get("properties", {})
        made["required"] += part.get("required", [])
    return made | schema


def type_of(schema, found):
    """The type of a value, and how it is built: a class's name with [] for each level of lists
    and {} of dictionaries, or nothing."""
    if "$ref" in schema:
        name = schema["$ref"].removeprefix(PREFIX)
        if name in OPEN:
            return "dict[str, Any]", ""
        if "properties" not in flat(SCHEMAS[name]):
            return type_of(SCHEMAS[name], found)
        found.append(name)
        return RENAMED.get(name, name), RENAMED.get(name, name)
    if "oneOf" in schema:
        parts = [type_of(part, found) for part in schema["oneOf"]]
        return " | ".join(dict.fromkeys(kind for kind, _ in parts)), "".join(built for _, built in parts)
    kind = schema.get("type")
    if isinstance(kind, list):
        parts = [type_of({**schema, "type": one}, found) for one in kind]
        return " | ".join(kind for kind, _ in parts), "".join(built for _, built in parts)
    if kind == "array":
        item, built = type_of(schema.get("items", {}), found)
        return f"list[{item}]", f"{built}[]" if built else ""
    if kind == "object":
        item, built = type_of(schema.get("additionalProperties") or {}, found)
        return f"dict[str, {item}]", f"{built}{{}}" if built else ""
    return PLAIN.get(kind, "Any"), ""


def text_block(text, indent):
    lines = textwrap.wrap(" ".join(text.split()), 116 - indent, break_long_words=False, break_on_hyphens=False)
    return ("\n" + " " * indent).join(lines)


def class_of(name, found):
    schema = flat(SCHEMAS[name])
    required = set(schema.get("required", []))
    fields, builders = [], {}
    for field, of in schema["properties"].items():
        kind, built = type_of(of, found)
        python = field + "_" if keyword.iskeyword(field) or field == "self" else field
        if built:
            builders[field] = built
        if field not in required and "None" not in kind.split(" | "):
            kind += " | None"
        told = of.get("description") or next((p["description"] for p in of.get("oneOf", []) if "description" in p), "")
        fields.append((python, kind, field not in required, told))
    yield f"@dataclass(frozen=True, kw_only=True, repr=False)\nclass {RENAMED.get(name, name)}(Document):"
    yield f'    """{text_block(schema.get("description", name), 4)}"""\n'
    yield f"    _built: ClassVar[dict[str, str]] = {json.dumps(builders)}\n"
    for python, kind, optional, told in fields:
        yield f"    {python}: {kind}" + (" = None" if optional else "")
        if told:
            yield f'    """{text_block(told, 4)}"""'
    yield "\n"


def reports():
    """The text of reports.py."""
    wanted, done, blocks = [name for name in DOCUMENTS if name in SCHEMAS], set(), []
    while wanted:
        name = wanted.pop(0)
        if name in done:
            continue
        done.add(name)
        found = []
        blocks.append((name, "\n".join(class_of(name, found))))
        wanted += found
    head = '''"""The reports as classes, one for each document of the service's OpenAPI description.

Written by scripts/release/python_types.py from openapi/ventriform.json: change that, not this. Lengths are millimetres,
volumes millilitres, angles degrees, as the names' endings say. Positions are LPS.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ._documents import Document, register

'''
    names = ", ".join(RENAMED.get(name, name) for name, _ in sorted(blocks))
    tail = f"register(\n    {text_block(names, 4)},\n)\n"
    return head + "\n" + "\n".join(text for _, text in sorted(blocks)) + "\n" + tail


def stub():
    """The text of _functions.pyi."""
    from ventriform import _tables

    source = (PACKAGE / "_functions.py").read_text()
    tree = ast.parse(source)
    lines = [
        '"""Signatures of `_functions`. Written by scripts/release/python_types.py: change that, or the library\'s '
        'tables."""',
        "",
    ]
    results = [alias.name for node in tree.body if getattr(node, "module", "") == "_results" for alias in node.names]
    lines += [
        "import os",
        "from collections.abc import Iterable, Mapping, Sequence",
        "from datetime import datetime",
        "from typing import Any, Literal",
        "",
    ]
    lines += [f"from ._results import {', '.join(name for name in results if name[0].isupper())}", ""]
    for node in tree.body:
        if isinstance(node, ast.Assign) and node.targets[0].id not in ("__all__",):
            lines.append(ast.unparse(node))
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
            continue
        commands = [arg.value for d in node.decorator_list if isinstance(d, ast.Call) for arg in d.args]
        node.decorator_list, node.body = [], [ast.Expr(ast.Constant(...))]
        if commands:
            taken = {a.arg for a in node.args.args + node.args.kwonlyargs + node.args.posonlyargs}
            node.args.kwarg = None
            for row in [row for command in commands for row in _tables.rows(command)]:
                if row["name"] not in taken:
                    annotation = ast.parse(_tables.annotation(row), mode="eval").body
                    node.args.kwonlyargs.append(ast.arg(row["name"], annotation))
                    node.args.kw_defaults.append(ast.Constant(_tables.default(row)))
        lines.append(wrapped(ast.unparse(node)))
    return "\n".join(lines) + "\n"


def wrapped(definition):
    """A function's one line as one argument a line."""
    node = ast.parse(definition).body[0]
    args, parts = node.args, []
    positional = args.posonlyargs + args.args
    defaults = [None] * (len(positional) - len(args.defaults)) + args.defaults
    pairs = [(a, d) for a, d in zip(positional, defaults)]
    for arg, default in pairs:
        parts.append(argument(arg, default))
    if args.vararg:
        parts.append("*" + argument(args.vararg, None))
    elif args.kwonlyargs:
        parts.append("*")
    if args.kwonlyargs:
        parts += [argument(a, d) for a, d in zip(args.kwonlyargs, args.kw_defaults)]
    returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    body = "".join(f"    {part},\n" for part in parts)
    return f"def {node.name}(\n{body}){returns}: ..."


def argument(arg, default):
    kind = f": {ast.unparse(arg.annotation)}" if arg.annotation else ""
    return f"{arg.arg}{kind}" + (f" = {ast.unparse(default)}" if default is not None else "")


def reference():
    """The functions that take parameters, as `help` shows them in the installed package."""
    import ventriform

    def shown(parameter):
        default = None if parameter.default is parameter.empty else repr(parameter.default)
        return {
            "name": parameter.name,
            "kind": parameter.kind.description,
            "annotation": parameter.annotation,
            "default": default,
        }

    taking = {name: made for name, made in vars(ventriform).items() if hasattr(made, "__signature__")}
    return {
        name: {"docstring": made.__doc__, "parameters": [shown(p) for p in inspect.signature(made).parameters.values()]}
        for name, made in taking.items()
    }


DOCUMENT = pathlib.Path(os.environ.get("DOCUMENT", ROOT / "openapi/ventriform.json"))
SCHEMAS = json.loads(DOCUMENT.read_text())["components"]["schemas"]


def main():
    command = sys.argv[1]
    if command == "reference":
        pathlib.Path(sys.argv[2]).write_text(json.dumps(reference()))
    else:
        print({"reports": reports, "functions": stub}[command](), end="")


if __name__ == "__main__":
    main()
