"""Panoramas by OpenGL, on a GPU or by Mesa: pyrender draws the faces of a cube, and cubemap.py makes panoramas of them.

pyrender uploads the world once and draws it, textures included. It draws into a framebuffer of ours: its own takes four samples for
each pixel, which mixes colours on edges as no exact renderer does, and always reads the depth back. The depth is reversed, which
keeps far surfaces apart whatever the near plane is (gl.Framebuffer, Camera).

Only this module imports pyrender, and only when a renderer is opened: the import binds PyOpenGL to one platform for good.
"""

import weakref
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import InputError, SettingError
from tussock.world.mesh_materials import face_rgb, texture_factor, texture_of
from tussock.world.scene import World

from .cubemap import Cubemap, Face, face_size_for
from .eye import Eye
from .gl import Context, Framebuffer, open_context
from .poses import Poses, Views, poses_of_eye

NEAR = 1e-4  # m; surfaces closer to the eye are not drawn. There is no far limit.


class RasterRenderer:
    """Panoramas by OpenGL, a `Renderer`.

    Textures are drawn in their colours, without their alpha: a leaf cut out of a rectangle by alpha shows the rectangle.

    Args:
        world: The world.
        eye: The eye.
        backend: "egl" or "osmesa".
        face_size: Edge of a cube face (pixels); None is what the eye needs.

    Raises:
        InputError: The backend is not available here, or the faces are too large for it.
    """

    def __init__(self, world: World, eye: Eye, backend: str, face_size: int | None = None):
        if face_size is not None and face_size < 1:
            raise SettingError(f"cube faces of {face_size} pixels cannot be drawn; give at least 1, or None")
        self.world, self.eye, self.backend, self._face_size = world, eye, backend, face_size
        self._cubemap = Cubemap(eye, face_size or face_size_for(eye))
        self._context = open_context(backend)
        import pyrender

        self._flags = pyrender.RenderFlags.FLAT
        self._scene, self._camera = _scene(world)
        with self._context:
            self._framebuffer = Framebuffer(self._cubemap.size, self._cubemap.rows)
            self._pyrender = pyrender.Renderer(self._cubemap.size, self._cubemap.size)
        self._atlas = np.empty((self._cubemap.rows, self._cubemap.size, 4), dtype=np.uint8)
        # Runs when the renderer is closed, deleted, or at exit, while the context exists; pyrender's own clean-up comes too late.
        self._free = weakref.finalize(self, _free, self._context, self._pyrender, self._framebuffer)

    def __reduce__(self):
        """In another process it is opened anew."""
        return RasterRenderer, (self.world, self.eye, self.backend, self._face_size)

    def render(self, poses: Poses) -> Views:
        """See `Renderer.render`. Threads may share a renderer; they take turns."""
        if not self._free.alive:
            raise InputError("this renderer is closed; open another one")
        poses = poses_of_eye(self.world, self.eye, poses)
        views = np.empty((len(poses), self.eye.height, self.eye.width, 4), dtype=np.uint8)
        with self._context:
            for pose, view in zip(poses, views, strict=True):
                for face in self._cubemap.faces:
                    self._draw(face, pose)
                self._framebuffer.read(self._atlas)
                view[:] = self._cubemap.unwrap(self._atlas)
        return views

    def _draw(self, face: Face, pose: Float[np.ndarray, " 4"]) -> None:
        """Draw one face of the cube around the eye at a pose into its rows of the atlas."""
        x, y, heading, z = pose
        c, s = np.cos(heading), np.sin(heading)
        right, up, forward = face.axes @ np.array([(c, s, 0), (-s, c, 0), (0, 0, 1)])
        camera = np.eye(4)
        camera[:3] = np.column_stack([right, up, -forward, (x, y, z)])
        self._scene.set_pose(self._camera, camera)
        framebuffer, size = self._framebuffer, self._cubemap.size

        def select(flags: int) -> None:
            framebuffer.select(size, face.bottom, face.rows, face.offset)

        self._pyrender._configure_forward_pass_viewport = select  # pyrender calls this to choose where it draws
        self._pyrender.render(self._scene, self._flags)

    def close(self) -> None:
        """Free what the renderer holds in OpenGL; closing twice does nothing."""
        self._free()

    def __enter__(self) -> "RasterRenderer":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()


def _free(context: Context, renderer: Any, framebuffer: Framebuffer) -> None:
    with context:
        renderer.delete()
        framebuffer.delete()


def _scene(world: World) -> tuple[Any, Any]:
    """A pyrender scene of a world, and the node of its camera."""
    import pyrender

    class Camera(pyrender.Camera):
        """Shows 90 degrees, without a far plane, with a depth from 1 near to 0 at infinity."""

        def get_projection_matrix(self, width=None, height=None):
            return np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, NEAR), (0, 0, -1, 0)], dtype=float)

    scene = pyrender.Scene(bg_color=[*(c / 255 for c in world.sky_rgb), 0.0])
    primitives = [_textured(mesh, world.double_sided) for mesh in world.textured]
    triangles, rgb = world.surfaces()
    if world.textured:  # these meshes are all triangles of the world, so only the ground remains
        triangles, rgb = triangles[len(world.triangles) :], rgb[len(world.triangles) :]
    if len(triangles):
        primitives.append(_coloured(triangles, rgb, world.double_sided))
    if primitives:
        scene.add(pyrender.Mesh(primitives))
    camera = pyrender.Node(camera=Camera(znear=NEAR), matrix=np.eye(4))
    scene.add_node(camera)
    return scene, camera


def _coloured(triangles: Float[np.ndarray, "n 3 3"], rgb: UInt8[np.ndarray, "n 3"], double_sided: bool) -> Any:
    """A pyrender primitive of triangles that have one colour each."""
    import pyrender

    return pyrender.Primitive(
        positions=triangles.reshape(-1, 3),
        color_0=np.repeat(rgb, 3, axis=0),
        material=pyrender.MetallicRoughnessMaterial(alphaMode="OPAQUE", doubleSided=double_sided),
    )


def _textured(mesh: Any, double_sided: bool) -> Any:
    """A pyrender primitive of a trimesh mesh with its texture, or with its colours where it has no texture."""
    import pyrender

    image = texture_of(mesh)
    if image is None:
        return _coloured(mesh.triangles, face_rgb(mesh), double_sided)
    texels = np.array(image.convert("RGBA"))
    texels[..., 3] = 255  # alpha is the share of a pixel that is covered, and a textured triangle covers it
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
