"""Files that a user names: regular ones only, and none that unpacks to far more than it holds, checked before any work.
"""

import stat
from pathlib import Path

from touchcal.errors import InputFileError

# What a file may hold unpacked, bytes: this much, or else this many times its own size.
UNPACKED_BYTES, UNPACKED_TIMES = 100_000_000, 100


def regular(path: Path | str) -> Path:
    """The path of a regular file; InputFileError for a folder, a pipe or a device, of which reading may never end."""
    path = Path(path)
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        raise InputFileError(path, "no such file. Check the name and the folder.") from None
    except (OSError, ValueError) as error:
        raise InputFileError(path, f"it cannot be opened ({error}).") from None
    if stat.S_ISDIR(mode):
        raise InputFileError(path, "this is a folder. Give one file.")
    if not stat.S_ISREG(mode):
        raise InputFileError(path, "this is a pipe or a device, no regular file. Save its content as a file first.")
    return path


def check_unpacked(path: Path, size: float) -> None:
    """InputFileError where a file states that it holds this many bytes unpacked, far more than its own size."""
    here = path.stat().st_size
    if size > max(UNPACKED_BYTES, UNPACKED_TIMES * here):
        raise InputFileError(path, f"its {here} bytes would unpack to {size:.3g}, more than {UNPACKED_TIMES} times as "
                                   "many: it is damaged, or not what it is named. Restore it from a copy.")
