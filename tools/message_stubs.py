# SPDX-License-Identifier: BSD-3-Clause
"""Stubs of the messages and services that ROS has generated, for pyright: fields with the types of their definitions.

    message_stubs.py FOLDER

genpy's classes set fields to None first, which a checker of types takes for their type. A field of a stub reads as
the type that it has on the wire, and takes all that genpy can write.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

_HEAD = '''from collections.abc import Iterable
from typing import Any, ClassVar, Self, SupportsFloat, SupportsIndex
import genpy
'''
_INTEGERS = {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)} | {"char", "byte"}
#: Type of a definition -> (what a field is read as, what it takes).
_PLAIN = {"string": ("str", "str"), "bool": ("bool", "bool"), "time": ("genpy.Time", "genpy.Time"),
          "duration": ("genpy.Duration", "genpy.Duration"),
          **dict.fromkeys(("float32", "float64"), ("float", "SupportsFloat")),
          **dict.fromkeys(_INTEGERS, ("int", "SupportsIndex"))}

#: Packages whose own names a stub would hide.
_WITH_CODE = ("actionlib", "dynamic_reconfigure", "tf")


def types_of(definition: str) -> tuple[str, str]:
    """The types that a field of this definition (``geometry_msgs/Pose[]``) is read as and takes."""
    element, bracket, _ = definition.partition("[")
    if bracket and element in ("uint8", "char"):
        return "bytes", "bytes | bytearray | memoryview | Iterable[int]"
    read, taken = _PLAIN.get(element) or (element.replace("/", ".msg."),) * 2
    return (f"list[{read}]", f"Iterable[{taken}]") if bracket else (read, taken)


def _constants(node: ast.ClassDef) -> dict[str, Any]:
    """The values that a class of genpy assigns to its names."""
    found: dict[str, Any] = {}
    for line in node.body:
        if isinstance(line, ast.Assign) and isinstance(line.targets[0], ast.Name):
            try:
                found[line.targets[0].id] = ast.literal_eval(line.value)
            except ValueError:
                found[line.targets[0].id] = ast.unparse(line.value)
    return found


def stub_of(node: ast.ClassDef) -> list[str]:
    """The lines of the stub of a message, or of a service, whose parts are messages."""
    values = _constants(node)
    is_message = "__slots__" in values
    lines = [f"class {node.name}{'(genpy.Message)' * is_message}:"]
    for name, value in values.items():
        if name in ("_request_class", "_response_class"):
            lines.append(f"    {name}: type[{value}]")
        elif name not in ("__slots__", "_slot_types", "_has_header"):
            lines.append(f"    {name}: ClassVar[{type(value).__name__}]")
    if is_message:
        fields = {field: types_of(kind) for field, kind in zip(values["__slots__"], values["_slot_types"], strict=True)}
        for field, (read, taken) in fields.items():
            lines += ["    @property", f"    def {field}(self) -> {read}: ...",
                      f"    @{field}.setter", f"    def {field}(self, value: {taken}) -> None: ..."]
        by_name = "".join(f", {field}: {taken} = ..." for field, (_, taken) in fields.items())
        lines += [f"    def __init__(self, *args: Any{by_name}) -> None: ...",
                  "    def deserialize(self, str: bytes) -> Self: ..."]
    return lines


def write_stubs(sources: Iterable[str], folder: Path) -> None:
    """Write stubs of the packages of messages or services in ``sources``; the first one of a name counts."""
    for generated in (path for source in reversed([*sources]) for kind in ("msg", "srv")
                      for path in Path(source).glob(f"*/{kind}")):
        if generated.parent.name in _WITH_CODE:
            continue
        lines, used = [], set()
        for path in sorted(generated.glob("_*.py")):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef):
                    lines += stub_of(node)
                elif isinstance(node, ast.Import):
                    used.update(name.name for name in node.names if name.name.endswith(".msg"))
        if lines:
            used.add(f"{generated.parent.name}.msg")
            stub = folder / generated.parent.name / generated.name / "__init__.pyi"
            stub.parent.mkdir(parents=True, exist_ok=True)
            stub.write_text(_HEAD + "".join(f"import {name}\n" for name in sorted(used)) + "\n".join(lines) + "\n",
                            encoding="utf-8")


if __name__ == "__main__":
    write_stubs(sys.path, Path(sys.argv[1]))
