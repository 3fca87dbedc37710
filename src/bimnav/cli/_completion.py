"""`bimnav completion`: what makes a shell complete commands, options and their choices."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

from bimnav.cli._shared import DONE, show

if TYPE_CHECKING:
    from bimnav.cli._shared import Commands

_EXAMPLES = """\
examples:
  bimnav completion bash >> ~/.bashrc
  bimnav completion zsh >> ~/.zshrc
  bimnav completion fish > ~/.config/fish/completions/bimnav.fish
"""
_BASH = """\
_bimnav() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" words=""
  if [ "$COMP_CWORD" -eq 1 ]; then
    words="{commands} --help --version"
  else
    case "${{COMP_WORDS[1]}} $before" in
{choices}
      *)
        case "${{COMP_WORDS[1]}} $word" in
{options}
        esac ;;
    esac
  fi
  COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o default -F _bimnav bimnav
"""
_ZSH = "autoload -U +X compinit && compinit\nautoload -U +X bashcompinit && bashcompinit\n"


class _Option(NamedTuple):
    name: str
    takes_value: bool
    choices: tuple[str, ...]
    help: str


class _Command(NamedTuple):
    name: str
    help: str
    words: tuple[str, ...]  # actions, such as `show`
    options: tuple[_Option, ...]


def add_to(commands: Commands) -> None:
    """Add the command to the parser."""
    completion = commands.add_parser(
        "completion",
        help="print what makes a shell complete what you type",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    completion.add_argument("shell", choices=("bash", "zsh", "fish"))
    completion.set_defaults(command=lambda options: _command(options, commands))


def _command(options: argparse.Namespace, commands: Commands) -> int:
    known = list(_commands(commands))
    if options.shell == "fish":
        show("\n".join(_fish(known)))
    else:
        show((_ZSH if options.shell == "zsh" else "") + _bash(known).rstrip())
    return DONE


def _commands(commands: Commands) -> Iterator[_Command]:
    texts = {action.dest: action.help or "" for action in commands._choices_actions}
    for name, parser in commands.choices.items():
        words: list[str] = []
        options: dict[str, _Option] = {}
        for action in _actions_of(parser):
            choices = tuple(map(str, action.choices or ()))
            if not action.option_strings:
                words += choices
            for option in action.option_strings[-1:]:
                options[option] = _Option(option, action.nargs != 0, choices, action.help or "")
        yield _Command(name, texts[name], tuple(words), tuple(options.values()))


def _actions_of(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the actions of a parser, and those of the parsers below it."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from _actions_of(below)


def _bash(known: list[_Command]) -> str:
    choices = [
        f'      "{command.name} {option.name}") words="{" ".join(option.choices)}" ;;'
        for command in known
        for option in command.options
        if option.takes_value
    ]
    options = []
    for command in known:
        named = " ".join(option.name for option in command.options)
        options += [f'          "{command.name} -"*) words="{named}" ;;']
        options += [f'          "{command.name} "*) words="{" ".join(command.words)}" ;;'] if command.words else []
    names = " ".join(command.name for command in known)
    return _BASH.format(commands=names, choices="\n".join(choices), options="\n".join(options))


def _fish(known: list[_Command]) -> Iterator[str]:
    for command in known:
        yield f"complete -c bimnav -n __fish_use_subcommand -f -a {command.name} -d {_quoted(command.help)}"
        when = f"complete -c bimnav -n '__fish_seen_subcommand_from {command.name}'"
        if command.words:
            yield f"{when} -a {_quoted(' '.join(command.words))}"
        for option in command.options:
            values = f" -x -a {_quoted(' '.join(option.choices))}" if option.choices else " -r" * option.takes_value
            yield f"{when} -l {option.name.removeprefix('--')}{values} -d {_quoted(option.help)}"


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
