"""What README and docs print is what was measured."""

import shutil

import cv2
import make
import numpy as np
import pytest
from measurements import MEASUREMENTS
from pictures import ASSETS, digest, keep
from processors import compared


@pytest.mark.parametrize("page", make.PAGES, ids=lambda path: path.stem)
def test_a_page_prints_the_numbers_of_the_records(page):
    text = page.read_text()
    assert make.written(text, make.records()) == text
    assert text.count("<!-- number: ") == len(make.NUMBER.findall(text))
    assert bool(make.NUMBER.findall(text)) == bool(make.ORIGIN.findall(text))  # a reader sees where numbers come from


def test_every_measurement_has_a_record_and_a_page():
    printed = {name for page in make.PAGES for _, name, *_ in make.NUMBER.findall(page.read_text())}
    assert make.records().keys() == MEASUREMENTS.keys() == printed


def test_a_number_that_differs_from_its_record_is_seen():
    record = {"walk": {"values": {"mean_deviation_m": 0.0123, "steps": 5}, "origin": {}}}
    page = "it is <!-- number: walk.deviation -->9.9 cm<!-- end of number --> off"
    assert make.written(page, record) == page.replace("9.9 cm", "1.2 cm")


@pytest.mark.slow
def test_a_measurement_gives_its_record_again(tmp_path, monkeypatch):
    assets, run = tmp_path / "assets", tmp_path / "run"
    run.mkdir()
    monkeypatch.setattr("pictures.ASSETS", shutil.copytree(ASSETS, assets))
    assert MEASUREMENTS["walk"].measure(run) == make.records()["walk"]["values"]


def test_the_pictures_are_those_of_the_records():
    """A picture that was replaced by hand, or is of no measurement, is seen."""
    kept = {
        name: value for each in make.records().values() for name, value in each["values"].get("pictures", {}).items()
    }
    assert kept == {
        path.relative_to(ASSETS).as_posix(): digest(path)
        for path in ASSETS.rglob("*")
        if path.suffix in (".png", ".gif")
    }


def test_a_picture_is_replaced_only_where_it_looks_different(tmp_path, monkeypatch):
    monkeypatch.setattr("pictures.ASSETS", tmp_path)
    old, noisy, other = (np.full((64, 64, 3), 100, np.uint8) for _ in range(3))
    noisy[::8, ::8] += 20
    other[16:32, 16:32] += 20
    for picture, kept in ((old, old), (noisy, old), (other, other)):
        cv2.imwrite(str(tmp_path / "new.png"), picture)
        keep(tmp_path / "new.png", "picture.png")
        assert (cv2.imread(str(tmp_path / "picture.png")) == kept).all()


def test_walks_that_differ_on_another_processor_are_counted():
    usual = {("tiny", seed): ("arrived", f"steps {seed}") for seed in range(4)}
    other = usual | {("tiny", 0): ("arrived", "other steps"), ("tiny", 1): ("lost", "other steps")}
    assert compared(usual, usual) == {"arrived": [4, 4], "other steps": 0, "end otherwise": 0}
    assert compared(usual, other) == {"arrived": [3, 4], "other steps": 2, "end otherwise": 1}
