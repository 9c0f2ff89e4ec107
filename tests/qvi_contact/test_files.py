"""Files are there whole or not at all, and a place that cannot be written is named in one line."""

import errno
import os
from pathlib import Path

import pytest

from qvi_contact import InputError
from qvi_contact.basics import check_writable, replacing, writable_folder, write_text
from tests.cases import refused_at


@pytest.fixture
def earlier(tmp_path):
    """An earlier file, alone in its folder."""
    path = tmp_path / "table.csv"
    path.write_text("earlier", encoding="utf-8")
    return path


def assert_untouched(path):
    assert path.read_text(encoding="utf-8") == "earlier"
    assert list(path.parent.iterdir()) == [path]


def test_the_target_changes_only_when_the_block_has_ended(earlier):
    with replacing(earlier) as temporary:
        assert temporary.parent == earlier.parent  # a rename across file systems is not atomic
        assert temporary.suffix == ".csv"  # writers choose the format by it
        temporary.write_text("later", encoding="utf-8")
        assert earlier.read_text(encoding="utf-8") == "earlier"
    assert earlier.read_text(encoding="utf-8") == "later"
    assert list(earlier.parent.iterdir()) == [earlier]


@pytest.mark.parametrize("failure", [ValueError("drawing failed"), KeyboardInterrupt()])
def test_a_failure_keeps_the_earlier_file(earlier, failure):
    def write():
        with replacing(earlier) as temporary:
            temporary.write_text("half", encoding="utf-8")
            raise failure

    with pytest.raises(type(failure)) as caught:
        write()
    assert caught.value is failure
    assert_untouched(earlier)


def test_a_full_disk_is_one_line_and_keeps_the_earlier_file(earlier, monkeypatch):
    def full(self, *_args, **_options):
        self.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", full)
    with refused_at("output", "No space left on device", str(earlier)):
        write_text(earlier, "later")
    monkeypatch.undo()
    assert_untouched(earlier)


def test_a_file_the_writer_removed_is_an_error(earlier):
    with pytest.raises(InputError, match="cannot be written"), replacing(earlier) as temporary:
        temporary.unlink()
    assert_untouched(earlier)


@pytest.mark.parametrize(
    "place", ["{file}/below/a.csv", "{folder}/missing/a\nb.csv", "/proc/a.csv", "{folder}/a\0b/a.csv", "{folder}"]
)
def test_places_without_files(earlier, place):
    target = Path(place.format(file=earlier, folder=earlier.parent))
    with refused_at("output", "cannot be written", str(target)):
        write_text(target, "text")
    assert_untouched(earlier)


@pytest.mark.parametrize("field", ["output", "store"])
@pytest.mark.parametrize("place", ["{file}", "{file}/below", "/proc/below", "/proc", "{file}\0"])
def test_folders_that_cannot_be_written_or_made_are_named_with_their_option(earlier, field, place):
    folder = place.format(file=earlier)
    with refused_at(field, value=folder):
        writable_folder(folder, field)
    assert_untouched(earlier)


@pytest.mark.parametrize(("mask", "mode"), [(0o022, 0o644), (0o077, 0o600), (0o000, 0o666)])
def test_permissions_are_those_of_any_new_file(tmp_path, mask, mode):
    before = os.umask(mask)
    try:
        write_text(tmp_path / "new", "μ\r\nσ\n")
    finally:
        after = os.umask(before)
    assert (tmp_path / "new").read_bytes() == "μ\r\nσ\n".encode()
    assert (tmp_path / "new").stat().st_mode & 0o777 == mode
    assert after == mask  # reading the mask has not changed it


@pytest.fixture(params=["there", "dangling", "chain"])
def link(request, tmp_path):
    """A symbolic link in another folder, and the file it leads to, which may not be there yet."""
    target, link = tmp_path / "data" / "table.csv", tmp_path / "links" / "name.csv"
    for folder in (target.parent, link.parent):
        folder.mkdir()
    if request.param != "dangling":
        target.write_text("earlier", encoding="utf-8")
    first = link.with_name("first.csv") if request.param == "chain" else link
    first.symlink_to(target)
    if first != link:
        link.symlink_to("first.csv")
    return link, target


def test_links_are_followed(link):
    name, target = link
    write_text(name, "later")
    assert (name.is_symlink(), target.is_symlink()) == (True, False)
    assert target.read_text(encoding="utf-8") == name.read_text(encoding="utf-8") == "later"
    assert list(target.parent.iterdir()) == [target]


@pytest.mark.parametrize("mode", [0o600, 0o755])
def test_a_file_keeps_its_mode(earlier, mode):
    earlier.chmod(mode)
    write_text(earlier, "later")
    assert (earlier.stat().st_mode & 0o777, earlier.read_text(encoding="utf-8")) == (mode, "later")


def test_a_pipe_is_written_into(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    check_writable(pipe)  # does not wait for a reader
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_text(pipe, "text")
        assert os.read(reader, 10) == b"text"
    finally:
        os.close(reader)
    assert pipe.is_fifo()
