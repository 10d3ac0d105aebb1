# ---
# jupyter:
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Your own data
#
# Panoramas with positions and headings are enough for nearly everything that `tussock` does: no model of the world is
# needed. This notebook goes from a folder of pictures to an image database, image differences, heading errors and a walk
# through the pictures. Then it takes a photo, and a 3D scan of a place.
#
# You have no pictures at hand? The notebook makes a folder that looks as yours could. With your own, leave out the cell that
# defines `take_pictures`, and set the four paths at the beginning of the import.

# %%
import re
from math import degrees
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from PIL import Image

from tussock import (
    Encoding,
    Experiment,
    Eye,
    InputError,
    MeshReading,
    TrainingSetup,
    VisualCompass,
    World,
    draw_panorama,
    generate_route,
    heading_errors,
    open_renderer,
    read_world,
    rotational,
    turn_of_columns,
)
from tussock.render.images import ImportSettings, check_database, import_database

# %% [markdown]
# ## What your folder must look like
#
# - **Pictures**, one for each position, all of one size. Panoramas: behind at both edges, ahead in the middle, left on the
#   left. Other lenses (mirrors, fisheyes, 360 x 180 spheres) are unwrapped: see [your data](../your-data.md).
# - **A table** with a row for each picture: its file name, x, y, and the heading that the camera faced. The names of the
#   columns say the units, such as `x_mm` or `heading_deg`. Any of the usual formats of tables will do.
#
# Two sets are best: pictures along a *route*, which are learned, and pictures on a *grid* around it, where an agent is
# tested. In the field, the grid is recorded with the camera always facing in one direction, such as east.
#
# Here both come from a generated world, with pictures of 2 degrees a pixel.

# %%
HERE = Path(mkdtemp())
world = World.generate("tussock-field", seed=7)
along = generate_route(world, seed=7, length=3.0).poses[::5]  # a picture every 5 cm
low, high = along[:, :2].min(axis=0) - 0.3, along[:, :2].max(axis=0) + 0.3
x, y = np.meshgrid(np.arange(low[0], high[0], 0.1), np.arange(low[1], high[1], 0.1))
around = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])  # every 10 cm, facing east


def take_pictures(name, poses):
    """Write a folder of pictures, and a table of where they were taken."""
    (HERE / name).mkdir()
    with open_renderer(world, Eye(width=180, height=38)) as renderer:
        for number, view in enumerate(renderer.render(poses)):
            Image.fromarray(view[..., :3]).save(HERE / name / f"img_{number:04d}.png")
    table = pd.DataFrame(
        {
            "filename": [f"img_{number:04d}.png" for number in range(len(poses))],
            "x_mm": (1000 * poses[:, 0]).round(1),
            "y_mm": (1000 * poses[:, 1]).round(1),
            "heading_deg": np.degrees(poses[:, 2]).round(2),
        }
    )
    table.to_csv(HERE / f"{name}.csv", index=False)
    return table


take_pictures("grid_pictures", around)
take_pictures("route_pictures", along).head()

# %% [markdown]
# ## Import
#
# The import makes a database in the format of BoB robotics, which other programs of the field read, too. In a terminal:
#
# ```sh
# tussock database import route_pictures --track route_pictures.csv --out route
# tussock database import grid_pictures --track grid_pictures.csv --kind grid --out grid
# ```
#
# and in Python as below. What the import assumes about your data, it says (in a notebook, in red). Read it.

# %%
PICTURES, TRACK = HERE / "route_pictures", HERE / "route_pictures.csv"
GRID_PICTURES, GRID_TRACK = HERE / "grid_pictures", HERE / "grid_pictures.csv"
of_a_grid = ImportSettings(kind="grid")

route_database, _ = import_database(HERE / "route", PICTURES, TRACK)
grid_database, _ = import_database(HERE / "grid", GRID_PICTURES, GRID_TRACK, settings=of_a_grid)
print(len(route_database), "pictures of the route,", len(grid_database), "of the grid")
print(*sorted(path.name for path in (HERE / "route").iterdir())[:3], "...", sep="\n")

# %% [markdown]
# Headings are where most errors happen: compass bearings count clockwise from north, mathematics counter-clockwise from
# east. `tussock` compares them with the direction of the path, and refuses what does not fit. Here is the same table with
# its headings counted clockwise:

# %%
table = pd.read_csv(TRACK)
table["heading_deg"] *= -1
table.to_csv(HERE / "clockwise.csv", index=False)
try:
    import_database(HERE / "wrong", PICTURES, HERE / "clockwise.csv")
except InputError as error:
    print(*re.split(r"(?<=[;,:]) ", str(error)), sep="\n")

# %% [markdown]
# The message names the option that reads them right. `ImportSettings(headings="clockwise")` is the same in Python.
#
# A database can be checked at any time, also one that came from others. In a terminal it is `tussock database check route`.

# %%
problems = [*check_database(HERE / "route"), *check_database(HERE / "grid")]
print(f"{len(problems)} problems")

# %% [markdown]
# **Look at one picture.** No program can know whether a picture is mirrored: in a mirrored database, every heading is wrong,
# and nothing else looks odd. Find something that you know to be on the left.

# %%
figure, rows = plt.subplots(2, figsize=(8, 5.5), layout="constrained")
for axes, row in zip(rows, (0, 20), strict=True):
    x, y, heading = route_database.poses[row]
    title = f"at x {x:.2f} m, y {y:.2f} m, facing {degrees(heading):.0f} degrees"
    draw_panorama(axes, route_database.views([row])[0], title)
    axes.set(yticks=[0, 15, 75], yticklabels=["-15", "0", "60"])
    axes.set(ylabel="elevation (degrees)")

# %% [markdown]
# ## Image differences
#
# An `Experiment` with databases takes the place of one with a world. Its "renderer" gives, at any pose, the picture of the
# nearest entry, rolled to the heading.
#
# How different are the pictures of the route from those of the grid beside it, at every rotation?

# %%
images = Experiment(
    route_database=HERE / "route",
    grid_database=HERE / "grid",
    encoding="grey | resize 2",  # 4 degrees a pixel
    training=TrainingSetup(learning_walk=0.0),
)
place, route = images.open_world_and_route()
with images.open_renderer(place) as views:
    curves = rotational(views, images.encoding, route.poses[5:-5:5], [0.0, 0.1, 0.2])
for each in curves:
    turns = np.degrees(turn_of_columns(np.arange(len(each.curve)), len(each.curve)))
    order = turns.argsort()
    label = f"{100 * each.distance:.0f} cm away, as a mean"
    plt.plot(turns[order], each.curve[order], label=label)
plt.xticks(range(-180, 181, 45))
plt.xlabel("turn to the left of the heading on the route (degrees)")
plt.ylabel("image difference (RMS)")
plt.legend()
plt.show()

# %% [markdown]
# The valley in the middle is what an agent steers by. If yours has none, look at these first: are the headings right? Is
# the camera level, and does its own body or your shadow appear in each picture? Is the grid too coarse for plants that
# are this near?
#
# ## A scan at each position of the grid
#
# Now an agent learns the pictures of the route. At each position of the grid within 20 cm of it, it scans all headings and
# takes the most familiar one. The right heading is that of the nearest picture of the route.

# %%
distance, _ = route.nearest(grid_database.poses[:, :2])
tested = grid_database.poses[distance <= 0.2]
errors = {}
for model in ("perfect-memory", "infomax", "visual-compass"):
    with images.replace(model=model).opened() as trained:
        learned, views = trained.model.model, trained.renderer
        errors[model] = heading_errors(learned, images.encoding, views, route, tested)

rows = {}
for model, each in errors.items():
    rows[model] = {
        "positions": len(each),
        "median error (degrees)": f"{each.median_error_deg:.1f}",
        "mean error (degrees)": f"{each.mean_error_deg:.1f}",
        "over 45 degrees": f"{each.share_over_45:.1%}",
    }
pd.DataFrame(rows).T

# %% [markdown]
# The last column is the share of headings that are over 45 degrees off, which studies count as failures. Perfect memory
# keeps all pictures, infomax trains one network with them, and the visual compass keeps a single picture: that of the route's end.
# Perfect memory has the smallest errors of the three. On the map, each arrow is the heading at one position:

# %%
found = errors["perfect-memory"]
(x, y), heading = found.positions.T, found.headings
figure, axes = plt.subplots(figsize=(8, 6), layout="constrained")
axes.plot(*route.xy.T, color="lightgrey", lw=6, label="route")
axes.plot(*route.goal[:2], "*", color="grey", ms=14, label="end of the route")
arrows = axes.quiver(
    *(x, y, np.cos(heading), np.sin(heading), np.degrees(found.errors)), cmap="viridis_r", scale=12, width=0.008
)
figure.colorbar(arrows, label="error of the heading (degrees)")
axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
axes.legend(loc="upper left", bbox_to_anchor=(1, 1))
plt.show()

# %% [markdown]
# ## A walk through the pictures
#
# An agent can also walk, from picture to picture. With a learning walk, it learns the pictures of the grid beside the route,
# too, turned to face the route ahead. Where no picture is near, the walk ends, with the reason `off the grid`.

# %%
walk = images.replace(start_offset=0.1, training__learning_walk=0.2).run()
summary = walk.summary()
farthest = 100 * summary["max_view_distance_m"]
print(f"{summary['reason']}; the farthest picture that it used was {farthest:.0f} cm away")

figure, axes = plt.subplots(figsize=(8, 6), layout="constrained")
axes.plot(*grid_database.poses[:, :2].T, ".", color="lightgrey", label="pictures of the grid")
axes.plot(*route.xy.T, color="grey", lw=4, label="route")
axes.plot(*walk.xy.T, color="crimson", label="walk")
axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
axes.legend(loc="upper left", bbox_to_anchor=(1, 1))
plt.show()

# %% [markdown]
# A walk through pictures is coarser than a real one: between two positions of the grid nothing changes. Choose the spacing
# of the grid well below the distance over which your valleys lead.
#
# ## A photo
#
# One panoramic photo is an array: height x width x 3 numbers from 0 to 255. Any encoding and model takes it. Here a view of a
# generated world is turned by 90 degrees, and the visual compass finds out by how much. For a photo of yours, put
# `photo = np.asarray(Image.open("photo.jpg").convert("RGB"))` in its place.

# %%
with open_renderer(World.generate("tussock-field", seed=7)) as renderer:
    photo = renderer.render(np.array([[5.0, 5.0, 0.0]]))[0, ..., :3]
turned = np.roll(photo, photo.shape[1] // 4, axis=1)  # as after a turn of 90 degrees to the left
encoding = Encoding.parse("grey | resize 6 | normalise")
compass = VisualCompass().fit(encoding(photo[None]))
familiarity = compass.scan(encoding(turned[None]))[0].numpy()

figure, (above, below) = plt.subplots(2, figsize=(8, 6), layout="constrained")
draw_panorama(above, turned, "the turned photo")
turns = np.degrees(turn_of_columns(np.arange(len(familiarity)), len(familiarity)))
order = turns.argsort()
below.plot(turns[order], familiarity[order])
best = turns[familiarity.argmax()]
below.axvline(best, color="crimson", label=f"the most familiar: {best:.0f} degrees")
below.set(xticks=range(-180, 181, 45), xlabel="turn to the left (degrees)", ylabel="familiarity")
below.legend()
plt.show()

# %% [markdown]
# The most familiar heading is 90 degrees to the right: it turns the photo back. For a mirror or a fisheye lens,
# `tussock unwrap picture.jpg --out panorama.png` makes the panorama first.
#
# ## A 3D scan
#
# A mesh of your site, from photogrammetry or a laser scanner, is a world like any other. Point clouds must be made to meshes
# first. Two things must be known: which axis of the file points **up**, and the **unit** of its numbers.
#
# The cell makes a scan as other programs write it: an OBJ file in millimetres, with y up, and the ground as part of the mesh.

# %%
piece = World.generate("tiny", seed=3)
x0, y0, x1, y1 = piece.field
inside = piece.field.contains(*piece.triangles[..., :2].mean(axis=1).T)
floor = np.array([[[x0, y0, 0], [x1, y0, 0], [x1, y1, 0]], [[x0, y0, 0], [x1, y1, 0], [x0, y1, 0]]])
corners = np.concatenate([piece.triangles[inside], floor]).reshape(-1, 3)
colours = np.concatenate([piece.rgb[inside], [piece.ground.rgb] * 2]).repeat(3, axis=0)

lines = []
for (x, y, z), (red, green, blue) in zip(1000 * corners, colours / 255, strict=True):
    lines.append(f"v {x:.2f} {z:.2f} {-y:.2f} {red:.3f} {green:.3f} {blue:.3f}")
for first in range(1, len(corners), 3):
    lines.append(f"f {first} {first + 1} {first + 2}")
(HERE / "scan.obj").write_text("\n".join(lines))

scan = read_world(HERE / "scan.obj", MeshReading(up="y", unit="mm"))
width, depth, height = np.ptp(scan.triangles.reshape(-1, 3), axis=0)
print(f"{len(scan.triangles)} triangles, {width:.1f} m x {depth:.1f} m, {height:.2f} m high")

# %% [markdown]
# Compare these lengths with your site: a wrong unit is seen at once. `ground="mesh"` lets the agent stand on the
# surface of the scan. Then all is as in a generated world.

# %%
eye = Eye(width=180, height=38)
on_scan = Experiment(world=scan, ground="mesh", seed=3, eye=eye, route_length=2.0)
ground, through = on_scan.open_world_and_route()
with on_scan.open_renderer(ground) as renderer:
    view = renderer.render([through.start])[0]
walk = on_scan.run()

figure, (above, below) = plt.subplots(2, figsize=(7, 8), layout="constrained", height_ratios=(1, 2))
draw_panorama(above, view, "the start of the route, in the scan")
above.set(yticks=[0, 15, 75], yticklabels=["-15", "0", "60"])
above.set(ylabel="elevation (degrees)")
below.plot(*through.xy.T, color="lightgrey", lw=6, label="route")
below.plot(*walk.xy.T, color="crimson", label=f"walk: {walk.summary()['reason']}")
below.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
below.legend()
plt.show()

# %% [markdown]
# Your own routes (tables of trackers, GPS, motion capture) are read by `tussock.read_route`, or with
# `Experiment(world=..., route="track.csv")`. [Your data](../your-data.md) lists the formats, what is assumed of each, and what
# is refused.
