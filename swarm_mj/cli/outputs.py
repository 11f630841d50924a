"""Files that commands write, checked before the work."""

from pathlib import Path

from swarm_mj.io.atomic import temp_path


def check_outputs(outputs: dict[str, Path | None], *, must_be_new: bool = False) -> None:
    """Passes if a command can write all its files; missing folders will be made.

    Args:
        outputs: The files by what they are called in a message; None is not written.
        must_be_new: Whether existing files are refused.

    Raises:
        ValueError: A file exists, is a folder, or its folder cannot be written; or two are the
            same.
    """
    named: dict[Path, str] = {}
    for what, path in outputs.items():
        if path is not None:
            _check(path, what, must_be_new=must_be_new)
            if path.resolve() in named:
                raise ValueError(f"{named[path.resolve()]} and {what} name the same file, {path}")
            named[path.resolve()] = what


def _check(path: Path, what: str, *, must_be_new: bool) -> None:
    try:
        if path.is_dir():
            raise ValueError(f"{what} {path} is a folder; name a file")
        if path.exists() and not path.is_file():
            raise ValueError(f"{what} {path} is a device or a pipe; name a file")
        if must_be_new and path.exists():
            raise ValueError(f"{what} {path} exists; name another, or replace it with --force")
        folder = next(parent for parent in path.absolute().parents if parent.exists())
        probe = temp_path(folder / path.name)
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{what} {path} cannot be written: {error.strerror}") from error
