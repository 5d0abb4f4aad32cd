# SPDX-License-Identifier: Apache-2.0
"""Writes the reference of the API from a descriptor set of its protos that has their comments.

Numbers in paths of comments are those of descriptor.proto (google/protobuf/descriptor.proto,
FileDescriptorProto, DescriptorProto, EnumDescriptorProto, ServiceDescriptorProto).
"""
import re

from google.protobuf import descriptor_pb2

import markdown_text

_FILE_MESSAGES, _FILE_ENUMS, _FILE_SERVICES = 4, 5, 6
_FIELDS, _NESTED_MESSAGES, _NESTED_ENUMS = 2, 3, 4
_ENUM_VALUES = 2
_METHODS = 2
_FIELD = descriptor_pb2.FieldDescriptorProto


def _text(comment):
    """A comment as Markdown: paragraphs; a block with aligned columns stays as it is."""
    out = []
    for paragraph in re.split(r"\n[ \t]*\n", comment.strip("\n")):
        lines = [line.removeprefix(" ") for line in paragraph.split("\n")]
        if any(re.search(r"\S {2,}\S", line) or line.startswith("  ") for line in lines):
            out.append(markdown_text.fenced("\n".join(lines)).rstrip())
        else:
            out.append(markdown_text.escaped("\n".join(lines).strip()))
    return "\n\n".join(out)


def _one_line(comment):
    """A comment in a cell of a table."""
    return markdown_text.cell(markdown_text.escaped(" ".join(comment.split())))


def _anchor(name):
    return name.lower().replace(".", "")


class ApiPages:
    """`files`: a FileDescriptorSet with source information, and the package that is described."""

    def __init__(self, files, package="rigcal.v1"):
        self._files = [file for file in files.file if file.package == package]
        self._package = "." + package + "."
        if not self._files:
            raise ValueError(f"no proto file has the package {package}")

    def calls(self):
        """The page of the services."""
        out = ["# Calls of the API", "",
               "Made from the comments of `proto/rigcal/v1`. [The API](../api.md) says how to call, and who may.", ""]
        for file in self._files:
            comments = _comments(file)
            for i, service in enumerate(file.service):
                path = (_FILE_SERVICES, i)
                out += [f"## {service.name}", "", _text(comments[path]), ""]
                for j, method in enumerate(service.method):
                    takes = ("stream of " if method.client_streaming else "") + self._link(method.input_type)
                    gives = ("stream of " if method.server_streaming else "") + self._link(method.output_type)
                    out += [f"### {service.name}.{method.name}", "", f"{takes} → {gives}", "",
                            _text(comments[path + (_METHODS, j)]), ""]
        return "\n".join(out)

    def messages(self):
        """The page of the messages and enumerations, by file."""
        out = ["# Messages of the API", "",
               "Made from the comments of `proto/rigcal/v1`. [Calls of the API](calls.md) take and give them.", ""]
        for file in self._files:
            comments = _comments(file)
            body = []
            for i, message in enumerate(file.message_type):
                body += self._message(message, (_FILE_MESSAGES, i), message.name, comments)
            for i, enum in enumerate(file.enum_type):
                body += self._enum(enum, (_FILE_ENUMS, i), enum.name, comments)
            if body:
                out += [f"## {file.name.rpartition('/')[2]}", "", *body]
        return "\n".join(out)

    def _message(self, message, path, name, comments):
        out = [f"### {name}", "", _text(comments[path]), ""]
        if message.field:
            out += ["| field | type | |", "|---|---|---|"]
            for i, field in enumerate(message.field):
                meaning = comments[path + (_FIELDS, i)]
                out.append(f"| `{field.name}` = {field.number} | {self._type(field, message)} | {_one_line(meaning)} |")
            out.append("")
        for i, nested in enumerate(message.nested_type):
            if not nested.options.map_entry:
                out += self._message(nested, path + (_NESTED_MESSAGES, i), f"{name}.{nested.name}", comments)
        for i, enum in enumerate(message.enum_type):
            out += self._enum(enum, path + (_NESTED_ENUMS, i), f"{name}.{enum.name}", comments)
        return out

    def _enum(self, enum, path, name, comments):
        out = [f"### {name}", "", _text(comments[path]), "", "| value | |", "|---|---|"]
        for i, value in enumerate(enum.value):
            out.append(f"| `{value.name}` = {value.number} | {_one_line(comments[path + (_ENUM_VALUES, i)])} |")
        return out + [""]

    def _type(self, field, message):
        for nested in message.nested_type:
            if nested.options.map_entry and field.type_name.endswith("." + nested.name):
                return f"map of {self._type(nested.field[0], nested)} to {self._type(nested.field[1], nested)}"
        name = self._link(field.type_name) if field.type_name else _FIELD.Type.Name(field.type)[len("TYPE_"):].lower()
        if field.label == _FIELD.LABEL_REPEATED:
            return "repeated " + name
        return ("optional " if field.proto3_optional else "") + name

    def _link(self, type_name):
        """Type names are ".rigcal.v1.Lens.State"."""
        if not type_name.startswith(self._package):
            return "`" + type_name.lstrip(".") + "`"
        name = type_name[len(self._package):]
        return f"[{name}](messages.md#{_anchor(name)})"


class _Comments(dict):
    """By the path of what they stand above; "": it has none."""

    def __missing__(self, path):
        return ""


def _comments(file):
    return _Comments({tuple(location.path): location.leading_comments
                      for location in file.source_code_info.location if location.leading_comments})
