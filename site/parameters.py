"""Gives the Python reference the parameters that come from the library's tables: in the sources they are
`**parameters`.

In: target/site/reference.json, which scripts/release/python_types.py writes of the installed package. Out: signature
and docstring of each function there, as `help` shows them.
"""

import json
import pathlib
import re

import griffe

REFERENCE = pathlib.Path(__file__).resolve().parent.parent / "target/site/reference.json"
CHOICES = re.compile(r"^(\w+ : )\{([^}\n]*)\}(?=,| or |$)", re.M)
TOGETHER = re.compile(r"^(\w+(?:, \w+)+)\n( +.*)$", re.M)


def readable(docstring):
    """A docstring without what griffe reads otherwise than meant: the first of {...} and of several names would be the
    default of the parameter, and of them all."""
    docstring = CHOICES.sub(lambda found: found[1] + " | ".join(found[2].split(", ")), docstring)
    return TOGETHER.sub(lambda found: "\n".join(f"{name}\n{found[2]}" for name in found[1].split(", ")), docstring)


class TableParameters(griffe.Extension):
    def on_package(self, *, pkg, **_):
        for name, told in json.loads(REFERENCE.read_text()).items():
            function = pkg[f"_functions.{name}"]
            function.docstring.value = readable(told["docstring"])
            function.parameters = griffe.Parameters(
                *(
                    griffe.Parameter(
                        one["name"],
                        kind=griffe.ParameterKind(one["kind"]),
                        annotation=one["annotation"],
                        default=one["default"],
                    )
                    for one in told["parameters"]
                )
            )
