"""Files that others wrote are read if they are what they must be, and refused in a line if not."""

import json
import os
import threading
from dataclasses import dataclass

import pytest

from swarm_mj.system.fields import setting
from swarm_mj.system.reading import open_file, read_document, read_file, read_json, read_plain


@dataclass(frozen=True, kw_only=True)
class Inner:
    x: float

    def __post_init__(self):
        if self.x > 9.0:
            raise ValueError("x must be up to 9")


@dataclass(frozen=True, kw_only=True)
class Outer:
    inner: Inner
    names: tuple[str, ...] = ()
    more: dict[str, int] | None = None


@dataclass(frozen=True, kw_only=True)
class Grown:
    old: int
    new: int = 7


@dataclass(frozen=True, kw_only=True)
class Renamed:
    present: float = setting(former=("early", "later"))


SOUND = {"inner": {"x": 1}, "names": ["a"], "more": None}


def test_a_file_comes_as_it_is(tmp_path):
    (tmp_path / "a").write_bytes(b"12345")
    (tmp_path / "link").symlink_to("a")
    assert read_file(tmp_path / "a", "file", 5) == b"12345"
    assert read_file(tmp_path / "link", "file", 5) == b"12345"
    with pytest.raises(ValueError, match=r"file .*a may have up to 4 bytes, not 5"):
        read_file(tmp_path / "a", "file", 4)


@pytest.mark.parametrize("kind", ["fifo", "device", "folder", "no folder", "loop", "missing"])
def test_what_is_no_file_is_refused_at_once(tmp_path, kind):
    path = tmp_path / "a"
    links = {"device": "/dev/zero", "no folder": path / "b", "loop": path}
    if kind in links:
        path.symlink_to(links[kind])
    elif kind != "missing":
        os.mkfifo(path) if kind == "fifo" else path.mkdir()
    said = []

    def attempt():
        with pytest.raises(ValueError, match=r"thing .*a( |$)") as error:
            open_file(path, "thing")
        said.append(str(error.value))

    reader = threading.Thread(target=attempt, daemon=True)
    reader.start()
    reader.join(3.0)
    assert len(said) == 1


def test_json_is_a_dataclass():
    assert read_json(json.dumps(SOUND), Outer) == Outer(inner=Inner(x=1.0), names=("a",))
    assert read_json("[1, 2]", list) == [1, 2]


@pytest.mark.parametrize("former", ["early", "later"])
def test_a_field_is_read_by_its_former_names_too(former):
    assert read_json(f'{{"{former}": 0.5}}', Renamed) == Renamed(present=0.5)
    with pytest.raises(ValueError, match="unknown field"):  # which of both would count?
        read_json(f'{{"{former}": 0.5, "present": 0.5}}', Renamed)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"wings": 2}, "unknown field `wings`"),
        ({"inner": {"x": 1, "y": 2}}, r"unknown field `y` - at `\$.inner`"),
        ({"inner": {}}, "missing required field `x`"),
        ({"inner": {"x": "1"}}, "Expected `float`, got `str`"),
        ({"inner": {"x": 9.5}}, "x must be up to 9"),
        ({"names": "a"}, "Expected `array`, got `str`"),
        ({"more": {"a": 1.5}}, "Expected `int`"),
    ],
)
def test_json_of_another_kind_is_refused(change, complaint):
    with pytest.raises(ValueError, match=complaint):
        read_json(json.dumps(SOUND | change), Outer)


@pytest.mark.parametrize("text", ["", "[", "NaN", "[1e999]", b"\xff", b'["\xff"]', "[" * 10**5])
def test_what_is_no_json_is_refused(text):
    with pytest.raises(ValueError, match=r"JSON|UTF|truncated|range|utf|deep|codec"):
        read_json(text, list)


def test_a_document_says_what_it_is():
    def text(**header):
        return json.dumps(header | SOUND)

    assert read_document(text(format="f", format_version=2), "f", 2, Outer).names == ("a",)
    for header, complaint in (
        ({"format": "g", "format_version": 1}, 'its format must be "f", not .g.'),
        ({"format": "f", "format_version": 3}, "format_version is 3, .* reads 2; update it"),
        ({"format": "f", "format_version": 0}, "Expected `int` >= 1"),
        ({"format": "f"}, "missing required field `format_version`"),
    ):
        with pytest.raises(ValueError, match=complaint):
            read_document(text(**header), "f", 2, Outer)


def test_a_field_that_is_newer_than_a_file_has_its_default():
    assert read_plain({"old": 1}, Grown) == Grown(old=1)
    assert read_plain({"old": 1, "new": 2}, Grown) == Grown(old=1, new=2)
    with pytest.raises(ValueError, match="missing required field `old`"):
        read_plain({"new": 2}, Grown)
