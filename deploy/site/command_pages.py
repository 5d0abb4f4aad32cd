# SPDX-License-Identifier: Apache-2.0
"""Writes the page of a program: every command and option, as its --help prints them."""
import markdown_text


def _entries(entries):
    out = ["| | |", "|---|---|"]
    for entry in entries:
        term = markdown_text.cell("`" + entry.term.replace("`", "'") + "`")
        out.append(f"| {term.replace('&#124;', '|')} | {markdown_text.cell(markdown_text.escaped(entry.text))} |")
    return out


def _section(section, known):
    entries = [entry for entry in section.entries if entry not in known]
    lines = section.lines if section.lines not in known else []
    if not entries and not lines:
        return []
    out = [markdown_text.escaped(section.title) + ":", ""] if section.title else []
    out += _entries(entries) if entries else [markdown_text.fenced("\n".join(lines))]
    return out + [""]


def _command(command, known):
    out = [markdown_text.fenced(command.usage), ""]
    first, _, rest = command.description.partition("\n")
    out = [markdown_text.escaped(first.strip()), "", *out]
    if rest.strip():
        out += [markdown_text.fenced(rest.strip("\n")), ""]
    for section in command.sections:
        if section.title == "Subcommands" and len(command.path) == 1:
            out += ["Commands:", ""]
            out += [f"- [{entry.names()[0]}](#{'-'.join(command.path + entry.names()[:1])}): "
                    + markdown_text.escaped(entry.text) for entry in section.entries]
            out.append("")
        else:
            out += _section(section, known)
    return out


def page(program):
    """`program`: the help_text.Command of a whole program. Returns Markdown."""
    out = [f"# {program.path[0]}", "", *_command(program, [])]
    # What the program's own help says is not repeated under each command.
    known = program.entries() + [section.lines for section in program.sections if section.lines]
    for command in program.all()[1:]:
        out += [f"{'#' * min(len(command.path), 4)} {' '.join(command.path)}", "", *_command(command, known)]
    return "\n".join(out) + "\n"
