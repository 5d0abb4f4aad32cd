# SPDX-License-Identifier: Apache-2.0
"""Reads what a program of rigcal and its commands print with --help (the layout of CLI11)."""
import dataclasses
import re
import subprocess


@dataclasses.dataclass(frozen=True)
class Entry:
    """An option, an argument or a subcommand: what is typed, and what it does."""

    term: str
    text: str

    def names(self):
        """"-o,--output-format table|json" -> ["-o", "--output-format"]."""
        return self.term.split()[0].split(",")

    def value(self):
        """"-o,--output-format table|json" -> "table|json"; "": it takes none."""
        value = re.sub(r"(Excludes|Needs): .*", "", self.term).split(None, 1)
        return value[1].strip() if len(value) == 2 else ""

    def choices(self):
        """The values that are allowed, where the help lists them."""
        listed = re.fullmatch(r"(?:\w+:)?\{([\w,.-]+)\}|(\w+(?:\|\w+)+)", self.value())
        words = re.split(r"[,|]", listed.group(1) or listed.group(2)) if listed else []
        return [word for word in words if not word.isupper()]  # FILE|ID: placeholders


@dataclasses.dataclass
class Section:
    """"Options:" and what is below it: entries, or lines that are kept as they are."""

    title: str
    entries: list
    lines: list


@dataclasses.dataclass
class Command:
    """A program (path of one word) or one of its commands ("rigcal session create")."""

    path: list
    description: str
    usage: str
    sections: list
    commands: list
    # Other words for the last one of the path.
    aliases: list = dataclasses.field(default_factory=list)

    def entries(self, is_wanted=lambda title: title not in ("Subcommands", "Positionals")):
        return [e for s in self.sections if is_wanted(s.title) for e in s.entries]

    def options(self):
        return [entry for entry in self.entries() if entry.term.startswith("-")]

    def all(self):
        """This one and every command below it."""
        return [self] + [c for command in self.commands for c in command.all()]


def _text_column(lines):
    """Where the texts of the entries begin: behind "-h,--help", which every help has."""
    for line in lines:
        found = re.match(r"  -h,--help +", line)
        if found:
            return found.end()
    raise ValueError("the help does not list -h,--help:\n" + "\n".join(lines))


def _entries(lines, column):
    entries = []
    for line in lines:
        if not line.startswith("   "):
            # A term that reaches the column has its text in the next line.
            fits = len(line) > column and line[column - 1] == " " and line[column] != " "
            term, text = (line[:column], line[column:]) if fits else (line, "")
            entries.append(Entry(" ".join(term.split()), text.strip()))
        elif entries:
            last = entries.pop()
            entries.append(Entry(last.term, f"{last.text} {line.strip()}".strip()))
    return entries


def _sections(lines, column):
    sections = []
    for line in lines:
        if line and not line.startswith(" "):
            title = line[:-1] if line.endswith(":") else ""
            if not title and sections and not sections[-1].title:
                sections[-1].lines.append(line)
            else:
                sections.append(Section(title, [], [] if title else [line]))
        elif sections:
            sections[-1].lines.append(line)
    for section in sections:
        body = [line for line in section.lines if line]
        has_entries = section.title in ("Positionals", "Options", "Subcommands")
        if has_entries or (section.title and body and body[0].startswith("  -")):
            section.entries, section.lines = _entries(body, column), []
        while section.lines and not section.lines[-1]:
            section.lines.pop()
    return sections


def parse(path, text):
    """The Command that this help is of, without those below it. ValueError: it is no help."""
    lines = [line.rstrip() for line in text.splitlines()]
    usage = next((i for i, line in enumerate(lines) if line.startswith("Usage: ")), None)
    if usage is None:
        raise ValueError(f"`{' '.join(path)} --help` has no line that begins with Usage:")
    sections = _sections(lines[usage + 1:], _text_column(lines))
    return Command(path, "\n".join(lines[:usage]).strip(), lines[usage][len("Usage: "):], sections, [])


def read(program, path):
    """The Command with all below it. `program`: the file to run; `path`: ["rigcal", "session"]."""
    run = subprocess.run([program, *path[1:], "--help"], capture_output=True, text=True, check=True)
    command = parse(path, run.stdout)
    for entry in command.entries(lambda title: title == "Subcommands"):
        below = read(program, path + entry.names()[:1])
        below.aliases = entry.names()[1:]
        command.commands.append(below)
    return command
