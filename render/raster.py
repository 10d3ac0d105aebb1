"""Panoramas drawn by OpenGL, on a GPU or by Mesa: the faces of a cube through pyrender, then unwrapped (cubemap.py).

pyrender uploads the world once and draws it, textures included. It draws into a picture of ours, for its own takes four
samples a pixel, whose mixtures on edges no exact renderer has, and is always read back with its depth; and with a
reversed depth, which keeps far things apart however near the near plane is (gl.Framebuffer, Camera).

This is the only module that imports pyrender, and does so late: the import binds PyOpenGL to a platform for good.
"""

import weakref
from types import TracebackType
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import InputError
from tussock.world.mesh_materials import face_rgb, texture_factor, texture_of
from tussock.world.scene import World

from .cubemap import Cubemap, Face, face_size_for
from .eye import Eye
from .gl import Context, Framebuffer, open_context
from .poses import Poses, as_poses

NEAR = 1e-4  # m; what is nearer to the eye is not seen. Nothing is too far.


class RasterRenderer:
    """Panoramas through OpenGL (see the module's docstring); a `Renderer`.

    backend: "egl" or "osmesa". face_size: edge of a cube face in pixels; None takes what the eye needs.
    A texture is drawn in its colours, its alpha ignored: a leaf cut out of a rectangle by alpha shows the rectangle.
    Raises InputError where the backend cannot be had.
    """

    def __init__(self, world: World, eye: Eye, backend: str, face_size: int | None = None):
        if face_size is not None and face_size < 1:
            raise InputError(
                f"cube faces of {face_size} pixels cannot be drawn; give at least 1, or None for what the eye needs"
            )
        self.world, self.eye, self.backend, self._face_size = world, eye, backend, face_size
        self._cubemap = Cubemap(eye, face_size or face_size_for(eye))
        self._context = open_context(backend)
        import pyrender

        self._flags = pyrender.RenderFlags.FLAT
        self._scene, self._camera = _scene(world)
        with self._context:
            self._picture = Framebuffer(self._cubemap.size, self._cubemap.rows)
            self._painter = pyrender.Renderer(self._cubemap.size, self._cubemap.size)
        self._atlas = np.empty((self._cubemap.rows, self._cubemap.size, 4), dtype=np.uint8)
        # Runs at close, when the renderer is dropped, or at exit; pyrender's own clean-up would find no context then.
        self._free = weakref.finalize(self, _free, self._context, self._painter, self._picture)

    def __reduce__(self):
        """Sent to another process, it is opened anew there."""
        return RasterRenderer, (self.world, self.eye, self.backend, self._face_size)

    def render(self, poses: Poses) -> UInt8[np.ndarray, "n height width 4"]:
        """See `Renderer.render`. Threads may share a renderer; they take turns."""
        if not self._free.alive:
            raise InputError("this renderer is closed; open another one")
        poses = as_poses(poses)
        views = np.empty((len(poses), self.eye.height, self.eye.width, 4), dtype=np.uint8)
        with self._context:
            for pose, view in zip(poses, views, strict=True):
                for face in self._cubemap.faces:
                    self._draw(face, pose)
                self._picture.read(self._atlas)
                view[:] = self._cubemap.unwrap(self._atlas)
        return views

    def _draw(self, face: Face, pose: Float[np.ndarray, " 3"]) -> None:
        """Draw one face of the cube around the eye at a pose into its place in the atlas."""
        x, y, heading = pose
        c, s = np.cos(heading), np.sin(heading)
        right, up, forward = face.axes @ np.array([(c, s, 0), (-s, c, 0), (0, 0, 1)])
        camera = np.eye(4)
        camera[:3] = np.column_stack([right, up, -forward, (x, y, self.eye.z)])
        self._scene.set_pose(self._camera, camera)
        picture, size = self._picture, self._cubemap.size

        def aim(flags: int) -> None:
            picture.aim(size, face.bottom, face.rows, face.offset)

        self._painter._configure_forward_pass_viewport = aim  # pyrender calls this to choose where it draws
        self._painter.render(self._scene, self._flags)

    def close(self) -> None:
        """Free what the renderer holds in the GL; closing twice does nothing."""
        self._free()

    def __enter__(self) -> "RasterRenderer":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def _free(context: Context, painter: Any, picture: Framebuffer) -> None:
    with context:
        painter.delete()
        picture.delete()


def _scene(world: World) -> tuple[Any, Any]:
    """A pyrender scene of a world, and the node of its camera."""
    import pyrender

    class Camera(pyrender.Camera):
        """Sees 90 degrees, without a far plane, its depth from 1 near to 0 at infinity."""

        def get_projection_matrix(self, width=None, height=None):
            return np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, NEAR), (0, 0, -1, 0)], dtype=float)

    scene = pyrender.Scene(bg_color=[*(c / 255 for c in world.sky_rgb), 0.0])
    primitives = [_textured(mesh, world.double_sided) for mesh in world.textured]
    triangles, rgb = world.surfaces()
    if world.textured:  # they are the world's triangles: only the ground comes without a texture
        triangles, rgb = triangles[len(world.triangles) :], rgb[len(world.triangles) :]
    if len(triangles):
        primitives.append(_coloured(triangles, rgb, world.double_sided))
    if primitives:
        scene.add(pyrender.Mesh(primitives))
    camera = pyrender.Node(camera=Camera(znear=NEAR), matrix=np.eye(4))
    scene.add_node(camera)
    return scene, camera


def _coloured(triangles: Float[np.ndarray, "n 3 3"], rgb: UInt8[np.ndarray, "n 3"], double_sided: bool) -> Any:
    """Triangles of one colour each, as pyrender draws them."""
    import pyrender

    return pyrender.Primitive(
        positions=triangles.reshape(-1, 3),
        color_0=np.repeat(rgb, 3, axis=0),
        material=pyrender.MetallicRoughnessMaterial(alphaMode="OPAQUE", doubleSided=double_sided),
    )


def _textured(mesh: Any, double_sided: bool) -> Any:
    """A trimesh mesh with its texture, or with its colours where it has none, as pyrender draws it."""
    import pyrender

    image = texture_of(mesh)
    if image is None:
        return _coloured(mesh.triangles, face_rgb(mesh), double_sided)
    texels = np.array(image.convert("RGBA"))
    texels[..., 3] = 255  # alpha is how much of a pixel is covered, and a textured triangle covers
    return pyrender.Primitive(
        positions=mesh.triangles.reshape(-1, 3),
        texcoord_0=mesh.visual.uv[mesh.faces].reshape(-1, 2),
        material=pyrender.MetallicRoughnessMaterial(
            baseColorFactor=(*texture_factor(mesh).tolist(), 1.0),
            # Without a sampler pyrender takes mipmaps with trilinear filtering, repeating.
            baseColorTexture=pyrender.Texture(source=texels, source_channels="RGBA"),
            alphaMode="OPAQUE",
            doubleSided=double_sided,
        ),
    )
