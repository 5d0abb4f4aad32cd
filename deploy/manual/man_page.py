# SPDX-License-Identifier: Apache-2.0
"""Writes a program's manual page (man(7)): the program first, then its commands, one by one."""


def _roff(text):
    """Text as roff shows it; a line of it is no request."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("~", "\\(ti").replace("^", "\\(ha")
    return "\n".join("\\&" + line if line[:1] in (".", "'") else line for line in text.split("\n"))


def _quoted(text):
    return '"' + _roff(text).replace('"', "\\(dq") + '"'


def _as_is(lines):
    return [".PP", ".nf", *[_roff(line) for line in lines], ".fi"] if lines else []


def _entry(entry):
    return [".TP", ".B " + _quoted(entry.term), _roff(entry.text)]


def _summary(command):
    """The first line, without the program's name before it."""
    first = command.description.split("\n")[0].split(". ")[0].rstrip(".")
    return first.removeprefix(command.path[0] + ":").strip()


def _section(section, heading, known):
    entries = [entry for entry in section.entries if entry not in known]
    lines = section.lines if section.lines not in known else []
    if not entries and not lines:
        return []
    # A section of a program that is no list of options has its title as a heading.
    out = [f".{heading} {_quoted(section.title.upper() if heading == 'SH' else section.title)}"]
    if not section.title:
        out = []
    elif heading == "PP":
        out = [] if section.title in ("Options", "Positionals") else [".PP", _roff(section.title) + ":"]
    return out + [line for entry in entries for line in _entry(entry)] + _as_is(lines)


def _command(command, known):
    out = [f".SS {_quoted(command.usage)}", _roff(command.description)]
    for section in command.sections:
        if section.title != "Subcommands":
            out += _section(section, "PP", known)
    return out


def page(program, version):
    """`program`: the Command of a whole program. Returns the text of the page."""
    name = program.path[0]
    out = [f'.TH {_quoted(name.upper())} 1 "" {_quoted(name + " " + version)} "User Commands"',
           # Words that people type are not broken.
           ".nh", ".ad l",
           ".SH NAME", f"{_roff(name)} \\- {_roff(_summary(program))}",
           ".SH SYNOPSIS", f".B {_quoted(program.usage)}",
           ".SH DESCRIPTION"]
    for paragraph in program.description.split("\n\n"):
        out += _as_is(paragraph.split("\n"))
    for section in program.sections:
        if section.title != "Subcommands":
            out += _section(section, "SH", [])
    # What the program's own help says is not repeated under each command.
    known = program.entries() + [section.lines for section in program.sections if section.lines]
    if program.commands:
        out.append(".SH COMMANDS")
    for command in program.all()[1:]:
        out += _command(command, known)
    others = [other for other in ("rigcal", "rigcal-agent", "rigcal-server", "rigcal-worker") if other != name]
    out += [".SH SEE ALSO", ",\n".join(f".BR {_roff(other)} (1)" for other in others).replace(",\n", " ,\n"),
            ".PP", "/usr/share/doc/rigcal holds the guides (package rigcal\\-doc)."]
    return "\n".join(out) + "\n"
