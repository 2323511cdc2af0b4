"""Files that are written whole or not at all, files of rows as they come, and files that are locked."""

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TextIO


@contextmanager
def written(path: Path) -> Iterator[BinaryIO]:
    """A file that takes the place of `path` in one step when the block ends, after the disk has it, so that no reader
    sees half of it; where the block raises, `path` stays as it was. Who may read it is as before, of a new file as the
    umask says."""
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with open(temporary, "xb") as file:
            keep_mode(path, temporary)
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        if error.filename in (None, str(temporary)) and error.strerror:
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def keep_mode(place: Path, fresh: Path) -> None:
    """Give the file `fresh` the permissions of the one at `place` that it is to replace, where there is one."""
    if place.is_file():
        fresh.chmod(stat.S_IMODE(place.stat().st_mode))


@contextmanager
def rows_written(path: Path) -> Iterator[TextIO]:
    """A file of rows that are written as they come; where the disk takes no more, it ends with the last whole one."""
    try:
        with open(path, "w", encoding="utf-8") as file:
            yield file
    except OSError as error:
        if error.filename is not None or not error.strerror:
            raise
        with open(path, "r+b") as cut:
            cut.truncate(cut.read().rfind(b"\n") + 1)
        raise OSError(error.errno, error.strerror, str(path)) from None


def lock_file(path: Path) -> BinaryIO:
    """A file to lock, made where it is missing and never cut; OSError where it is a link, since what a link points to
    is not this program's."""
    try:
        return os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666), "wb")
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise OSError(error.errno, "this is a link, where a file of this program belongs; remove it", str(path)
                      ) from None
