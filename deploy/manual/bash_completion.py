# SPDX-License-Identifier: Apache-2.0
"""Writes the bash completion of a program: its commands, options, and values that are listed."""

_SCRIPT = """\
# bash completion of {program}, made from its --help
{function}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}} command="" word words="" options=""
  COMPREPLY=()
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    case "${{command:+$command }}$word" in
{aliases}    esac
    case "${{command:+$command }}$word" in
      {commands}) command="${{command:+$command }}$word" ;;
    esac
  done
  case "$command:$previous" in
{values}
    *)
      case "$command" in
{words}
      esac
      [[ $current != -* ]] || words=$options
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}}
complete -o default -F {function} {program}
"""


def _case(pattern, body):
    return f"    {pattern}) {body} ;;"


def _values(command):
    """A line for each option of a command that takes a value."""
    where = " ".join(command.path[1:])
    for option in command.options():
        if not option.value() or option.value().startswith("["):
            continue
        pattern = "|".join(f'"{where}:{name}"' for name in option.names())
        if option.choices():
            yield _case(pattern, f'words="{" ".join(option.choices())}"')
        else:
            # Nothing is known of it; bash completes the names of files.
            yield _case(pattern, "return")


def script(program):
    """`program`: the Command of a whole program. Returns the text of the script."""
    name = program.path[0]
    below = [" ".join(command.path[1:]) for command in program.all()[1:]]
    words = []
    for command in program.all():
        options = " ".join(n for option in command.options() for n in option.names() if n.startswith("--"))
        # Where an argument is expected, nothing: bash completes the names of files.
        first = " ".join(below_it.path[-1] for below_it in command.commands)
        if not first and not command.entries(lambda title: title == "Positionals"):
            first = options
        words.append("    " + _case(f'"{" ".join(command.path[1:])}"', f'words="{first}" options="{options}"'))
    aliases = "".join(
        f'      "{" ".join([*command.path[1:-1], alias])}") word={command.path[-1]} ;;\n'
        for command in program.all() for alias in command.aliases)
    return _SCRIPT.format(
        aliases=aliases,
        program=name,
        function="_" + name.replace("-", "_"),
        commands=" | ".join(f'"{path}"' for path in below) or '""',
        values="\n".join(line for command in program.all() for line in _values(command)),
        words="\n".join(words))
