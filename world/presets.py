"""Presets of generated worlds: WorldParams with other defaults."""

from functools import partial

from .params import WorldParams

MEADOW = partial(
    WorldParams, ground_rgb=(172, 152, 102), sky_rgb=(176, 208, 238), cluster_plants=9.0, cluster_radius=0.5, clearings=4,
    tussock_density=0.4, tussock_height=0.24, tussock_rgb=(96, 150, 54), dry_share=0.08,
    grass_density=20.0, grass_height=0.13, grass_near_tussocks=0.15, grass_rgb=(122, 170, 62), flower_share=0.16,
    flower_rgb=(226, 96, 130), bush_density=0.02, bush_rgb=(70, 124, 58), stone_density=0.03, leaf_density=0.3,
    trees=42, tree_height=2.4, tree_gaps=0.2, tree_rgb=(64, 112, 58), tree_other_rgb=(96, 132, 60),
)  # fmt: skip
SCRUB = partial(
    WorldParams, ground_rgb=(206, 148, 104), sky_rgb=(196, 214, 226), patchiness=1.1, corridor_width=0.5,
    tussock_density=0.45, tussock_height=0.2, tussock_rgb=(150, 148, 84), dry_rgb=(214, 186, 120), dry_share=0.4,
    grass_density=11.0, grass_height=0.07, grass_rgb=(176, 160, 96), flower_share=0.0,
    bush_density=0.2, bush_height=0.5, bush_leaves=125, bush_rgb=(98, 116, 78), stone_density=0.4, stone_size=0.2,
    stone_rgb=(168, 128, 104), trees=32, tree_height=2.0, tree_gaps=0.45, tree_rgb=(88, 100, 66), tree_other_rgb=(132, 104, 70),
)  # fmt: skip
TINY = partial(  # fewer than 200 triangles for any seed
    WorldParams, field_width=3.0, field_depth=3.0, border=0.0, ground_margin=6.0, patchiness=0.3, cluster_plants=1.0,
    clearings=0, corridor_width=0.0, size_spread=0.25, tussock_density=0.56, tussock_height=0.24, tussock_blades=4,
    grass_density=1.78, grass_blades=2, grass_height=0.04, flower_share=0.0, bush_density=0.0, leaf_density=0.0,
    stone_density=0.0, trees=7, tree_height=1.3, tree_distance=0.9, tree_leaves=8,
)  # fmt: skip
HAY_MEADOW = partial(
    WorldParams, border=0.5, ground_margin=30.0, ground_rgb=(112, 92, 64), sky_rgb=(176, 208, 238), patchiness=0.5,
    cluster_plants=25.0, cluster_radius=0.08, size_spread=0.45, clearings=1, clearing_radius=0.5, corridor_width=0.4,
    tussock_density=0.6, tussock_height=0.3, tussock_rgb=(104, 146, 60), dry_rgb=(172, 152, 104), dry_share=0.15,
    grass_density=85.0, grass_height=0.17, grass_near_tussocks=0.05, grass_rgb=(112, 154, 58), flower_share=0.08,
    flower_rgb=(232, 196, 48), bush_density=0.0, leaf_density=0.0, stone_density=0.03,
    trees=36, tree_height=3.0, tree_gaps=0.25, tree_leaves=150, tree_rgb=(64, 112, 58), tree_other_rgb=(96, 132, 60), tree_forks=2,
    herb_density=6.0, herb_flower_rgb=(176, 112, 190), culm_density=18.0, culm_height=0.38,
    litter_density=300.0, litter_length=0.022, litter_stems=0.35, litter_green=0.6, leaf_rgb=(132, 102, 60),
    speckle=0.2, moss_share=0.55, hedge_height=3.0,
)  # fmt: skip
WOODLAND = partial(
    WorldParams, border=0.5, ground_margin=30.0, ground_rgb=(100, 78, 54), sky_rgb=(196, 214, 226), corridor_width=0.5,
    tussock_density=0.3, tussock_height=0.22, tussock_rgb=(96, 132, 56), dry_rgb=(158, 130, 88),
    grass_density=12.0, grass_height=0.1, grass_rgb=(104, 140, 58), flower_share=0.0,
    bush_density=0.3, bush_height=0.5, bush_leaves=100, leaf_density=0.0, stone_density=0.08,
    trees=60, tree_height=5.0, tree_gaps=0.05, tree_leaves=400, tree_density=0.12, tree_forks=3,
    herb_density=7.0, herb_flower_rgb=(236, 234, 224),
    litter_density=300.0, litter_length=0.032, litter_stems=0.15, litter_green=0.1, leaf_rgb=(146, 92, 50),
    speckle=0.2, moss_share=0.25, moss_rgb=(80, 102, 44), hedge_height=6.0,
)  # fmt: skip
DESERT = partial(
    WorldParams, border=0.5, ground_margin=40.0, ground_rgb=(196, 158, 112), sky_rgb=(178, 206, 236), patchiness=1.0,
    cluster_plants=4.0, cluster_radius=0.5, clearings=3, clearing_radius=0.9, corridor_width=0.6,
    tussock_density=0.3, tussock_height=0.22, tussock_blades=26, tussock_rgb=(164, 156, 98), dry_rgb=(206, 180, 122), dry_share=0.6,
    grass_density=2.5, grass_height=0.06, grass_rgb=(184, 168, 110), flower_share=0.0,
    bush_density=0.09, bush_height=0.4, bush_leaves=170, bush_rgb=(120, 124, 92), bark_rgb=(112, 92, 72),
    leaf_density=0.0, stone_density=0.12, stone_size=0.12, stone_rgb=(166, 128, 96),
    trees=9, tree_height=1.8, tree_distance=4.0, tree_gaps=0.6, tree_leaves=160, tree_rgb=(112, 118, 82), tree_other_rgb=(130, 120, 86),
    litter_density=15.0, litter_length=0.025, litter_stems=0.8, leaf_rgb=(150, 122, 86),
    speckle=0.09, speckle_size=0.06, pebble_density=55.0, pebble_size=0.02, far_hill_height=18.0,
)  # fmt: skip
