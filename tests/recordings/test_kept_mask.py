"""The mask of the robot's own body is kept with the recording, beside the ranges as they were measured."""

import json

import pytest
from mcap.reader import make_reader
from recorded_scans import assert_same
from robot_body import drive, on_posts

from lidarcore import open_recording
from lidarcore.body_mask import Sector, masked
from lidarcore.recordings.writer import RecordingWriter

MASK = (Sector(2.9, -3.0, 0.4), Sector(1.1, 1.3, 0.5))


def with_mask(path, *masks):
    """A recording of scans with posts of a robot in them, and these masks, one after the other; and its scans."""
    measured = drive(12)
    with RecordingWriter(path) as recording:
        for k, scan in enumerate(measured):
            recording.write(scan, mask=masks[k * len(masks) // len(measured)])
    return measured


def test_a_mask_is_kept_and_applies_and_the_ranges_stay(tmp_path):
    measured = with_mask(tmp_path / "a.mcap", MASK)
    recording = open_recording(tmp_path / "a.mcap")
    assert recording.mask == MASK
    for read, scan in zip(recording, measured, strict=True):
        assert_same(read, masked(scan, MASK))
        assert not read.valid[on_posts(read)].any()
    for read, scan in zip(open_recording(tmp_path / "a.mcap", mask=()), measured, strict=True):
        assert_same(read, scan)
    other = [Sector(0.0, 6.3, 1.0)]
    assert next(iter(open_recording(tmp_path / "a.mcap", mask=other))).ranges[0] >= 1
    assert recording.notes == ()


@pytest.mark.parametrize(
    ("masks", "kept"), [(((), MASK), MASK), ((MASK, ()), ()), ((MASK, MASK[:1]), MASK[:1])]
)
def test_of_a_mask_that_changes_the_last_is_kept(tmp_path, masks, kept):
    with_mask(tmp_path / "a.mcap", *masks)
    recording = open_recording(tmp_path / "a.mcap")
    assert recording.mask == kept
    assert len(list(recording)) == 12


def test_a_mask_is_where_other_readers_look_for_metadata(tmp_path):
    with_mask(tmp_path / "a.mcap", MASK)
    with (tmp_path / "a.mcap").open("rb") as file:
        found = [
            record.metadata for record in make_reader(file).iter_metadata() if record.name == "lidarcore"
        ]
    (text,) = [metadata["mask"] for metadata in found if "mask" in metadata]
    assert [list(sector.values()) for sector in json.loads(text)] == [
        [sector.first, sector.last, sector.reach] for sector in MASK
    ]


def test_a_mask_is_kept_in_a_recording_that_was_never_closed(tmp_path):
    recording = RecordingWriter(tmp_path / "a.mcap")
    for scan in drive(3):
        recording.write(scan, mask=MASK)
    recording.flush()
    assert open_recording(tmp_path / "a.mcap").mask == MASK


def test_a_damaged_mask_is_noted_and_the_scans_are_read(tmp_path):
    measured = with_mask(tmp_path / "a.mcap", MASK)
    content = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "b.mcap").write_bytes(content.replace(b'"reach":0.4', b'"reach":-10'))
    recording = open_recording(tmp_path / "b.mcap")
    assert recording.mask == ()
    assert "mask is not valid" in recording.notes[0]
    for read, scan in zip(recording, measured, strict=True):
        assert_same(read, scan)
