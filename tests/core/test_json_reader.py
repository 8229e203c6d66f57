"""JSON read item by item against the reader of Python that takes it whole."""

import io
import json
import random

import pytest

from lidarcore.files import json_reader
from lidarcore.files.json_reader import JsonReader

ITEMS = [{}, [], 'a\\"é]', -1.5e-7, 123456, True, None, {"b": [1, {"c": "}"}]}, [[], [2]]]


@pytest.mark.parametrize("piece", [1, 2, 3, 7, 1000])
@pytest.mark.parametrize("indent", [None, 1])
def test_a_document_in_pieces_of_any_size_is_the_document(monkeypatch, piece, indent) -> None:
    monkeypatch.setattr(json_reader, "PIECE", piece)
    reader = JsonReader(
        io.StringIO(json.dumps({"head": 12, "empty": [], "items": ITEMS, "none": {}}, indent=indent))
    )
    read = {
        name: list(reader.items()) if name in ("items", "empty") else reader.value()
        for name in reader.members()
    }
    assert (read, reader.next()) == ({"head": 12, "empty": [], "items": ITEMS, "none": {}}, "")


def test_what_python_refuses_is_refused() -> None:
    rng, text = random.Random(1), json.dumps(ITEMS)
    refused = 0
    for _ in range(3000):
        at = rng.randrange(len(text))
        mutated = text[:at] + rng.choice(["", "]", '"', ",", "0", "\n", "x"]) + text[at + rng.randrange(3) :]
        try:
            whole = json.loads(mutated)
        except ValueError:
            whole = ValueError
        assert items_of(mutated) == (whole if isinstance(whole, list) else ValueError), mutated
        refused += whole is ValueError
    assert 1000 < refused < 3000


def test_a_value_beyond_the_longest_is_refused() -> None:
    with pytest.raises(ValueError, match="longer"):
        list(JsonReader(io.StringIO('["' + "x" * 2 * json_reader.LONGEST)).items())


def items_of(text: str) -> object:
    reader = JsonReader(io.StringIO(text))
    try:
        items = list(reader.items())
        return ValueError if reader.next() else items
    except ValueError:
        return ValueError
