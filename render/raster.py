"""Panoramas by OpenGL, on a GPU or by Mesa: pyrender draws the faces of a cube, and cubemap.py makes panoramas of them.

pyrender uploads the world once and draws it, textures included. It draws into a framebuffer of ours: its own takes four samples for
each pixel, which mixes colours on edges as no exact renderer does, and always reads the depth back. The depth is reversed, which
keeps far surfaces apart whatever the near plane is (gl.Framebuffer, Camera). It draws with shaders of ours: its own do not leave out
the holes in textures, and take the texel in the middle of a pixel, not the one that the ray of the eye meets.

Only this module imports pyrender, and only when a renderer is opened: the import binds PyOpenGL to one platform for good.
"""

import weakref
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import InputError, SettingError
from tussock.world.full_pose import eye_axes
from tussock.world.scene import World
from tussock.world.textures import Texturing

from .cubemap import Cubemap, Face, face_size_for
from .eye import Eye
from .false_colours import seen_colours
from .gl import Context, Framebuffer, open_context
from .poses import AnyPoses, Views, poses_of_eye
from .sky import add_sky

NEAR = 1e-4  # m; surfaces closer to the eye are not drawn. There is no far limit.


class RasterRenderer:
    """Panoramas by OpenGL, a `Renderer`.

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
        from pyrender.shader_program import ShaderProgramCache

        self._flags = pyrender.RenderFlags.FLAT
        self._scene, self._camera = _scene(seen_colours(world, eye.spectrum), self._cubemap)
        with self._context:
            self._framebuffer = Framebuffer(self._cubemap.size, self._cubemap.rows)
            _check_sizes(world.texturing)
            self._pyrender = pyrender.Renderer(self._cubemap.size, self._cubemap.size)
        self._pyrender._program_cache = ShaderProgramCache(shader_dir=str(Path(__file__).parent / "shaders"))
        self._atlas = np.empty((self._cubemap.rows, self._cubemap.size, 4), dtype=np.uint8)
        # Runs when the renderer is closed, deleted, or at exit, while the context exists; pyrender's own clean-up comes too late.
        self._free = weakref.finalize(self, _free, self._context, self._pyrender, self._framebuffer)

    def __reduce__(self):
        """In another process it is opened anew."""
        return RasterRenderer, (self.world, self.eye, self.backend, self._face_size)

    def render(self, poses: AnyPoses) -> Views:
        """See `Renderer.render`. Threads may share a renderer; they take turns."""
        if not self._free.alive:
            raise InputError("this renderer is closed; open another one")
        poses = poses_of_eye(self.world, self.eye, poses)
        views = np.empty((len(poses), self.eye.height, self.eye.width, 4), dtype=np.uint8)
        with self._context:
            for position, axes, view in zip(poses[:, [0, 1, 3]], eye_axes(poses), views, strict=True):
                for face in self._cubemap.faces:
                    self._draw(face, position, axes)
                self._framebuffer.read(self._atlas)
                view[:] = self._cubemap.unwrap(self._atlas)
        add_sky(self.world, self.eye, poses, views)
        return views

    def _draw(self, face: Face, position: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]) -> None:
        """Draw one face of the cube around an eye (see `eye_axes`) into its rows of the atlas."""
        right, up, forward = face.axes @ axes
        camera = np.eye(4)
        camera[:3] = np.column_stack([right, up, -forward, position])
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


def _scene(world: World, cubemap: Cubemap) -> tuple[Any, Any]:
    """A pyrender scene of a world, and the node of its camera."""
    import pyrender

    class Camera(pyrender.Camera):
        """Shows 90 degrees, without a far plane, with a depth from 1 near to 0 at infinity."""

        def get_projection_matrix(self, width=None, height=None):
            return np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, NEAR), (0, 0, -1, 0)], dtype=float)

    sky = (0, 0, 0) if world.light else world.sky_rgb  # the sky of a light is added to the views, see sky.py
    scene = pyrender.Scene(bg_color=[*(c / 255 for c in sky), 0.0])
    triangles, rgb = world.surfaces()
    primitives = []
    if (texturing := world.surface_texturing()) is not None:
        n = len(texturing.index)
        primitives = _textured(triangles[:n], texturing, world.double_sided, _as_texture(cubemap.ray_offsets()))
        plain = np.ones(len(triangles), dtype=bool)  # and a ground of one colour
        plain[:n] = (texturing.index < 0) & (texturing.colours is None)
        triangles, rgb = triangles[plain], rgb[plain]
    if len(triangles):
        primitives.append(_coloured(triangles, np.repeat(rgb, 3, axis=0), world.double_sided))
    if primitives:
        scene.add(pyrender.Mesh(primitives))
    camera = pyrender.Node(camera=Camera(znear=NEAR), matrix=np.eye(4))
    scene.add_node(camera)
    return scene, camera


def _as_texture(offsets: Float[np.ndarray, "rows size 2"]) -> Any:
    """The offsets of rays, from -1/2 to 1/2, as a pyrender texture."""
    import pyrender
    from pyrender.constants import GLTF

    texels = np.zeros((*offsets.shape[:2], 4), dtype=np.uint8)
    texels[::-1, :, :2] = np.rint(255 * (offsets + 0.5)).clip(0, 255)  # pyrender turns pictures upside down
    sampler = pyrender.Sampler(magFilter=GLTF.NEAREST, minFilter=GLTF.NEAREST)
    return pyrender.Texture(source=texels, source_channels="RGBA", sampler=sampler)


def _coloured(
    triangles: Float[np.ndarray, "n 3 3"], colours: UInt8[np.ndarray, "m c"], double_sided: bool, offsets: Any = None
) -> Any:
    """A pyrender primitive of triangles without a texture.

    Args:
        triangles: The triangles.
        colours: (3 n, 3) or (3 n, 4) of their corners.
        double_sided: Whether their backs are seen.
        offsets: See `_as_texture`; None where each triangle has one colour.
    """
    import pyrender

    return pyrender.Primitive(
        positions=triangles.reshape(-1, 3),
        color_0=colours,
        material=pyrender.MetallicRoughnessMaterial(
            alphaMode="OPAQUE", doubleSided=double_sided, emissiveTexture=offsets
        ),
    )


def _textured(
    triangles: Float[np.ndarray, "n 3 3"], texturing: Texturing, double_sided: bool, offsets: Any
) -> list[Any]:
    """Pyrender primitives, one for each texture, and one for the triangles that have corner colours only.

    Their shader takes the texel that the ray of a pixel meets (offsets, in place of a picture of emitted light), and not the one in
    the middle of the pixel: so they agree with the exact renderer but for the edges of triangles.
    """
    import pyrender
    from pyrender.constants import GLTF

    wraps = {"repeat": GLTF.REPEAT, "mirror": GLTF.MIRRORED_REPEAT, "clamp": GLTF.CLAMP_TO_EDGE}
    filters = {"nearest": GLTF.NEAREST, "linear": GLTF.LINEAR}
    primitives, colours = [], texturing.colours
    if colours is not None and (texturing.index < 0).any():
        alone = texturing.index < 0
        primitives.append(_coloured(triangles[alone], colours[alone].reshape(-1, 4), double_sided, offsets))
    for number, texture in enumerate(texturing.textures):
        chosen = texturing.index == number
        if not chosen.any() or texture.threshold > 255:
            continue
        kind, (across, down) = filters[texture.filter], (wraps[wrap] for wrap in texture.wrap)
        sampler = pyrender.Sampler(magFilter=kind, minFilter=kind, wrapS=across, wrapT=down)
        material = pyrender.MetallicRoughnessMaterial(
            baseColorFactor=(
                1.0,
                1.0,
                1.0,
                texture.threshold / 255,
            ),  # what our shader takes as the least alpha that is seen
            emissiveTexture=offsets,
            baseColorTexture=pyrender.Texture(source=texture.rgba, source_channels="RGBA", sampler=sampler),
            alphaMode="OPAQUE",
            doubleSided=double_sided,
        )
        uv = texturing.uv[chosen].reshape(-1, 2)
        primitives.append(
            pyrender.Primitive(
                positions=triangles[chosen].reshape(-1, 3),
                texcoord_0=np.column_stack([uv[:, 0], 1 - uv[:, 1]]),  # pyrender's go up
                color_0=None if colours is None else colours[chosen].reshape(-1, 4),
                material=material,
            )
        )
    return primitives


def _check_sizes(texturing: Texturing | None) -> None:
    """Refuse textures that are larger than OpenGL allows here. The context must be current. Raises SettingError."""
    from OpenGL import GL

    limit: Any = GL.glGetIntegerv(GL.GL_MAX_TEXTURE_SIZE)
    for texture in () if texturing is None else texturing.textures:
        height, width = texture.rgba.shape[:2]
        if max(width, height) > limit:
            raise SettingError(
                f"a texture of the world has {width} x {height} pixels, and this OpenGL allows {limit}; "
                f"make it smaller, or use the cpu renderer"
            )
