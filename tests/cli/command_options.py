"""Walks the commands of the program."""

PLUGINS = {"bench", "train"}


def options_of(group, leave_out=PLUGINS, name=""):
    """Name of every command, groups within groups included -> its options; without the names in `leave_out`."""
    if not hasattr(group, "list_commands"):
        return {name: {option for parameter in group.params for option in parameter.opts}}
    found = {}
    for word in group.list_commands(None):
        if word not in leave_out:
            found |= options_of(group.get_command(None, word), leave_out, f"{name} {word}".strip())
    return found
