"""Every error the user can meet, in one tree. Each message names the value at fault and what to do next."""


class MaterialistError(Exception):
    """Base of all errors this package raises on purpose."""

    exit_code = 2


class InputError(MaterialistError):
    """A photo, map, mask or option that cannot be used as given."""


class SetupError(MaterialistError):
    """Something the machine lacks (LLVM, an optional extra); the message has the one command that mends it."""


class WeightsError(MaterialistError):
    """Network weights that are missing, damaged, or for another architecture."""


class SceneError(MaterialistError):
    """A scene package that is missing, incomplete, or of an unknown format version."""


class Interrupted(MaterialistError):
    """Ctrl-C, where something was kept that one can go on with; the message says what."""

    exit_code = 130


class OutputError(MaterialistError):
    """A result that cannot be written: the target exists, or the disk is full or read-only."""
