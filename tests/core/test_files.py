"""Files that are whole or not there, also when several write the same one at once."""

import threading

import pytest

from lidarcore.files import partials, replacing, write


def test_many_that_write_one_file_leave_one_of_their_texts_and_nothing_else(tmp_path):
    path, texts, errors = tmp_path / "hall.json", [str(n) * 200_000 for n in range(8)], []
    start = threading.Barrier(len(texts))

    def run(text):
        start.wait()
        try:
            for _ in range(20):
                write(path, text)
                if path.read_text("utf-8") not in texts:
                    errors.append("half a file")
        except OSError as error:
            errors.append(error)

    threads = [threading.Thread(target=run, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert list(tmp_path.iterdir()) == [path]


def test_what_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "hall.json"
    write(path, "old")

    def fail():
        with replacing(path) as partial:
            partial.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "old"


def test_what_one_that_was_killed_has_left_is_found_again(tmp_path):
    path = tmp_path / "a.html"
    with replacing(path) as one, replacing(path) as other:
        one.write_text("half")
        other.write_text("half")
        (tmp_path / ".b.json.part").write_text("of somebody else")
        assert set(partials(tmp_path, "*.html")) == set(partials(tmp_path, path.name)) == {one, other}
        assert list(partials(tmp_path, "b.html")) == []
