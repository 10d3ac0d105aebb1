"""Registries: every name finds what it stands for, whoever brings it, and an unknown one is refused with the known ones."""

import sys

import pytest

from tussock.world.errors import InputError, SettingError
from tussock.world.registry import Registry


class Mine:
    """A class from outside."""


@pytest.fixture
def registry() -> Registry:
    return Registry("tests", "thing", {"ours": "tussock.world.errors:InputError"})


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """A folder with a package that is installed, and the current folder with a module; both are forgotten afterwards."""
    package = tmp_path / "installed"
    info = package / "outside_package-1.0.dist-info"
    info.mkdir(parents=True)
    (package / "outside_package.py").write_text("class Theirs: pass\n")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: outside-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[tussock.tests]\ntheirs = outside_package:Theirs\nbroken = outside_package:Nothing\nours = outside_package:Theirs\n"
    )
    here = tmp_path / "here"
    here.mkdir()
    (here / "outside_module.py").write_text("class Local: pass\n")
    (here / "outside_broken.py").write_text("class Local\n")
    monkeypatch.setattr(sys, "path", [*sys.path, str(package)])
    monkeypatch.chdir(here)
    yield
    for name in ("outside_package", "outside_module", "outside_broken"):
        sys.modules.pop(name, None)


def test_a_name_of_tussock_finds_its_class_and_back(registry):
    assert registry.find("ours") is InputError
    assert registry.name_of(InputError) == "ours"
    assert "ours" in registry
    assert registry.names == ["ours"]


def test_a_registered_class_is_found_by_its_name(registry):
    registry.register("mine", Mine)
    assert registry.find("mine", importing=False) is Mine
    assert registry.name_of(Mine) == "mine"
    assert registry.names == ["ours", "mine"]
    assert registry.spec("mine").target is Mine


@pytest.mark.parametrize("name", ["ours", "", "my thing", "a|b", "a,b", "a=b", "a(b)"])
def test_a_name_that_cannot_be_registered_is_refused(registry, name):
    with pytest.raises(SettingError, match="thing") as refusal:
        registry.register(name, Mine)
    assert repr(name) in str(refusal.value)


def test_an_installed_package_brings_its_names(registry, outside):
    assert registry.names == ["ours", "theirs", "broken"]
    theirs = registry.find("theirs", importing=False)
    assert theirs.__name__ == "Theirs"
    assert registry.name_of(theirs) == "theirs"
    assert registry.find("ours") is InputError  # a package cannot take a name of tussock
    with pytest.raises(SettingError, match=r"'broken' of an installed package .*Nothing.*; repair"):
        registry.find("broken")


def test_a_location_is_imported_once_and_known_from_then_on(registry, outside):
    with pytest.raises(SettingError, match="import it first"):
        registry.find("outside_module:Local", importing=False)
    assert "outside_module" not in sys.modules
    local = registry.find("outside_module:Local")
    assert registry.find("outside_module:Local", importing=False) is local
    assert registry.name_of(local) == "outside_module:Local"
    assert "outside_module:Local" in registry.names


@pytest.mark.parametrize("location", ["nowhere:Thing", "outside_module:Nothing", "outside_broken:Local"])
def test_a_location_that_cannot_be_imported_is_refused_with_the_reason(registry, outside, location):
    with pytest.raises(SettingError, match="cannot be imported") as refusal:
        registry.find(location)
    assert repr(location) in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("name", ["other", "", "a/b.py:Thing", "a:b:c", ".:Local"])
def test_an_unknown_name_is_refused_with_the_known_ones(registry, name):
    with pytest.raises(SettingError, match="known: ours") as refusal:
        registry.find(name)
    assert repr(name) in str(refusal.value)


def test_an_error_of_a_spec_repeats_the_text(registry):
    registry.register("mine", Mine)
    for text in ("mine size=3", "mine 3", "other size=3"):
        with pytest.raises(SettingError) as refusal:
            registry.spec(text)
        assert text.split()[0] in str(refusal.value)
        assert "thing" in str(refusal.value)
