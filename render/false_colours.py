"""A world in the colours that an eye's receptors see: for an insect, ultraviolet in place of red, as pictures in false colours show it."""

import dataclasses

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import SettingError
from tussock.world.plant_groups import GROUND
from tussock.world.scene import World, once_per_world
from tussock.world.textures import Texturing, to_display, to_linear
from tussock.world.world_plants import PIECE

from .lighting import lit
from .spectrum import Insect, insect_of


def seen_colours(world: World, spectrum: str) -> World:
    """The world whose red, green and blue are what the receptors of a spectrum see; itself for people.

    Raises SettingError for a world that was read with its light: what of its colours is light is not known.
    """
    insect = insect_of(spectrum)
    if insect is None:
        return world
    kept = _by_spectrum(world)
    if spectrum not in kept:
        kept[spectrum] = _in_ultraviolet(world, insect)
    return kept[spectrum]


@once_per_world
def _by_spectrum(world: World) -> dict[str, World]:
    """The colours of a world that were made already; kept as long as the world."""
    return {}


def _in_ultraviolet(world: World, insect: Insect) -> World:
    """The world with ultraviolet in place of red; that of the sky is full."""
    if world.light is not None:
        if world.unlit is None:
            raise SettingError(
                "the world was read with its light, and how much of it is ultraviolet is not known; write it without a light, and give "
                "--light"
            )
        return lit(_in_ultraviolet(world.without_light(), insect), world.light)
    shares = reflected(world, insect)
    rgb = _with_red(world.rgb, _display(shares * _shading(world)))
    ground = world.ground
    if ground is not None:
        ground = dataclasses.replace(ground, rgb=(_display(np.array([insect.ground])).item(), *ground.rgb[1:]))
    return dataclasses.replace(
        world,
        rgb=rgb,
        reflectance=None if world.reflectance is None else _with_red(world.reflectance, _display(shares)),
        ground=ground,
        texturing=world.texturing and _textured(world.texturing, rgb),
        sky_rgb=(255, *world.sky_rgb[1:]),
    )


def reflected(world: World, insect: Insect) -> Float[np.ndarray, " n"]:
    """The share of the ultraviolet that each triangle of a world reflects."""
    groups = world.plants
    if groups is None:
        return np.full(len(world.triangles), insect.other)
    shares_of = {"stone": insect.stones, "pebble": insect.stones, PIECE: insect.other}
    of_kind = np.array([shares_of.get(kind, insect.plants) for kind in groups.kinds], dtype=float)
    shares = groups.per_triangle(of_kind[groups.kind], insect.other)
    shares[groups.of == GROUND] = insect.ground
    return shares


def _shading(world: World) -> Float[np.ndarray, " n"]:
    """The light in the colours of triangles, as a multiple of even light, as their green shows it; 1 where that is not known."""
    if world.reflectance is None:
        return np.ones(len(world.rgb))
    shown, even = (to_linear(each[:, 1] / 255) for each in (world.rgb, world.reflectance))
    return np.divide(shown, even, out=np.ones_like(even), where=even > 0)


def _display(shares: Float[np.ndarray, "..."]) -> UInt8[np.ndarray, "..."]:
    """Shares of light as display values; over 1 as 1."""
    return np.rint(255 * to_display(np.clip(shares, 0, 1))).astype(np.uint8)


def _with_red(rgb: UInt8[np.ndarray, "... c"], red: UInt8[np.ndarray, "..."]) -> UInt8[np.ndarray, "... c"]:
    changed = rgb.copy()
    changed[..., 0] = red
    return changed


def _textured(texturing: Texturing, rgb: UInt8[np.ndarray, "n 3"]) -> Texturing:
    """Textures whose red is full, on triangles whose corners have the ultraviolet."""
    textures = tuple(
        dataclasses.replace(each, rgba=_with_red(each.rgba, np.full(each.rgba.shape[:2], 255, np.uint8)))
        for each in texturing.textures
    )
    colours = _with_red(texturing.corner_colours(rgb), rgb[:, :1])
    return dataclasses.replace(texturing, textures=textures, colours=colours)
