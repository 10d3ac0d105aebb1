"""Light: where the sun is, how bright surfaces are in it, and what the sky looks like. All brightness is linear light.

Colours are reflectances (see `World.reflectance`). A surface with the unit normal n, seen from either side, gets

    E = D v |n . s| + A (1 + |n_z|) / 2

of direct light from the sun, in the direction s, where v is the share of it that the sun shines on, and of diffuse light from the
sky. Both sides are equally bright: leaves let light through, and the far side of a solid is in the shadow of the solid itself. The
brightest surface possible, D + A, keeps its own colour, as an eye adapts to the light around it.

D and A are those of Campbell and Norman (1998, An Introduction to Environmental Biophysics, chapter 11): of the light of a sun that
is h high, a clear atmosphere lets tau^m through, m = 1 / sin h being its thickness (by Kasten and Young 1989, which is right near the
horizon, too), and 0.3 (1 - tau^m) sin h comes from the sky. Clouds take direct light away and add diffuse light.

The sky is that of the CIE general sky (ISO 15469:2004): its types 12 (clear, low turbidity) and 1 (overcast), mixed by clouds.
"""

import math
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from .errors import SettingError
from .registry import Registry
from .settings import number, settings
from .specs import Spec

TRANSMITTANCE = 0.7  # tau, on a clear day
UNDER_CLOUDS = 0.3  # diffuse light under clouds, as a share of all light of a clear day
MIN_DIFFUSE = 1e-3  # at twilight
GRAZING = math.radians(0.01)  # over the horizon; from lower the sun lights nothing
TWILIGHT = math.radians(-6.0)  # civil; below it is night
PRESSURE = 1010.0  # hPa; the atmosphere lifts the sun by half a degree at the horizon
REFRACTED = math.radians(-0.575)  # no light of the sun comes around the earth from below this
CLEAR_SKY = (-1.0, -0.32, 10.0, -3.0, 0.45)  # a, b, c, d, e of ISO 15469, type 12
OVERCAST_SKY = (4.0, -0.70, 0.0, -1.0, 0.0)  # type 1
GREY = 0.6  # share of its colour that an overcast sky loses; a clear sky is bluer than the world's sky of one colour
BRIGHT_PART = 0.7  # quantile of the brightness of the sky at which it has the world's sky colour


@settings
class Light:
    """The light of a moment.

    Attributes:
        azimuth: Direction of the sun (rad, counter-clockwise from east).
        elevation: Height of the sun over the horizon (rad); at twilight it is below.
        clouds: From a clear sky, 0, to an overcast one, 1.
        latitude: Where on earth this is (rad); it decides how the sun moves.
    """

    azimuth: float = number(math.radians(-60.0), unit="rad")
    elevation: float = number(math.radians(45.0), low=TWILIGHT, high=math.pi / 2, unit="rad")
    clouds: float = number(0.0, low=0, high=1, unit="share")
    latitude: float = number(math.radians(51.0), low=-math.pi / 2, high=math.pi / 2, unit="rad")

    @property
    def sun(self) -> Float[np.ndarray, "3"]:
        """Unit vector towards the sun: east, north, up."""
        level = math.cos(self.elevation)
        return np.array([level * math.cos(self.azimuth), level * math.sin(self.azimuth), math.sin(self.elevation)])

    @property
    def direct(self) -> float:
        """D: light from the sun on a surface that faces it, as a share of that outside the atmosphere."""
        if self.elevation <= GRAZING:
            return 0.0
        return (1 - self.clouds) * TRANSMITTANCE ** air_mass(self.elevation)

    @property
    def diffuse(self) -> float:
        """A: light from the sky on level ground, likewise."""
        rise = max(math.sin(self.elevation), 0.0)
        through = TRANSMITTANCE ** air_mass(max(self.elevation, 0.0))
        clear = 0.3 * (1 - through) * rise
        return max(clear + self.clouds * (UNDER_CLOUDS * (through * rise + clear) - clear), MIN_DIFFUSE)

    def on(
        self, normals: Float[np.ndarray, "n 3"], sunlit: Float[np.ndarray, " n"] | float = 1.0
    ) -> Float[np.ndarray, " n"]:
        """Light on surfaces with unit normals, a share of which the sun shines on (0..1), as a share of the brightest possible."""
        direct = self.direct * sunlit * np.abs(normals @ self.sun)
        return (direct + self.diffuse * (1 + np.abs(normals[:, 2])) / 2) / (self.direct + self.diffuse)

    def later(self, hours: float) -> "Light":
        """The light some hours later on the same day; earlier where they are negative.

        The sun turns about the axis of the earth by 15 degrees an hour.

        Raises:
            SettingError: Where it is night then.
        """
        axis = np.array([0.0, math.cos(self.latitude), math.sin(self.latitude)])  # to the celestial north pole
        angle, sun = -math.radians(15.0) * hours, self.sun
        cos, sin = math.cos(angle), math.sin(angle)
        x, y, z = (sun * cos + np.cross(axis, sun) * sin + axis * (axis @ sun) * (1 - cos)).tolist()
        elevation = math.asin(max(-1.0, min(1.0, z)))
        if elevation < TWILIGHT:
            raise SettingError(
                f"{hours:g} hours later the sun is {-math.degrees(elevation):.0f} degrees below the horizon: it is night; "
                "give fewer hours, or another sun"
            )
        return Light(azimuth=math.atan2(y, x), elevation=elevation, clouds=self.clouds, latitude=self.latitude)


def air_mass(elevation: float) -> float:
    """Thickness of the atmosphere in a direction over the horizon (rad), as a multiple of that overhead. Kasten and Young 1989."""
    degrees = math.degrees(elevation)
    return 1 / (math.sin(elevation) + 0.50572 * (degrees + 6.07995) ** -1.6364)


def sky_luminance(light: Light, directions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Brightness of the sky in directions (unit vectors), as a multiple of that overhead; below the horizon that of the horizon."""
    up = np.clip(directions[:, 2], 0.0, 1.0)
    from_sun = np.arccos(np.clip(directions @ light.sun, -1, 1))
    zenith_from_sun = math.pi / 2 - light.elevation

    def of_type(a: float, b: float, c: float, d: float, e: float) -> Float[np.ndarray, " n"]:
        """phi(Z) f(chi) / (phi(0) f(Z_s)) of the standard."""

        def gradation(cosine: Any) -> Any:
            return 1 + a * np.exp(b / np.maximum(cosine, 1e-6))

        def scattering(chi: Any) -> Any:
            return 1 + c * (np.exp(d * chi) - math.exp(d * math.pi / 2)) + e * np.cos(chi) ** 2

        return gradation(up) * scattering(from_sun) / (gradation(1.0) * scattering(zenith_from_sun))

    return (1 - light.clouds) * of_type(*CLEAR_SKY) + light.clouds * of_type(*OVERCAST_SKY)


def sky_colours(
    light: Light, sky_rgb: tuple[int, int, int], directions: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Display colours (0..255) of the sky in directions (unit vectors). `sky_rgb` is that of its bright part."""
    from .textures import to_display, to_linear

    own = to_linear(np.array(sky_rgb) / 255)
    grey = own + GREY * (own.mean() - own)
    colour = light.clouds * grey + (1 - light.clouds) * own * (own / max(own.max(), 1e-9))
    relative = sky_luminance(light, directions) / np.quantile(sky_luminance(light, _hemisphere()), BRIGHT_PART)
    return 255 * to_display(np.clip(relative[:, None] * colour, 0, 1))


def _hemisphere(n: int = 2000) -> Float[np.ndarray, "n 3"]:
    """Directions spread evenly over the sky: a spiral with the golden angle."""
    z, turn = (np.arange(n) + 0.5) / n, np.arange(n) * math.pi * (3 - math.sqrt(5))
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])


def polarisation(
    light: Light, directions: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Polarisation of the sky by single Rayleigh scattering.

    At an angle g from the sun its degree is MAX_POLARISATION sin^2 g / (1 + cos^2 g), and its e-vector is at right angles to the
    plane through the sun, the eye, and the point of the sky. Clouds weaken it.

    Returns:
        The degree (0..1), and the e-vectors: unit vectors; 0 at the sun.
    """
    cosine = directions @ light.sun
    degree = MAX_POLARISATION * (1 - light.clouds) * (1 - cosine**2) / (1 + cosine**2)
    across = np.cross(directions, light.sun)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return degree, np.divide(across, length, out=np.zeros_like(across), where=length > 1e-12)


MAX_POLARISATION = 0.8  # of a clear sky; below 1 as light is scattered more than once (Horvath and Varju 2004)


def daylight(latitude: float, longitude: float, time: str, clouds: float = 0.0) -> Light:
    """The light at a place and a time, by the ephemeris of the library ephem.

    Args:
        latitude: Of the place (rad, north positive).
        longitude: Of the place (rad, east positive).
        time: In ISO 8601, such as 2026-06-21T10:30 (universal time) or 2026-06-21T10:30+02:00.
        clouds: See `Light`.

    Raises:
        SettingError: For a time that cannot be read, and at night.
    """
    from datetime import UTC, datetime

    import ephem

    try:
        moment = datetime.fromisoformat(str(time))
    except ValueError as error:
        raise SettingError(f"the time is {time!r}; give it as 2026-06-21T10:30, or with +02:00 at its end") from error
    if not abs(longitude) <= 2 * math.pi:
        raise SettingError(
            f"longitude is {longitude!r}; give one from -pi to pi (rad), or longitude_deg from -180 to 180"
        )
    moment = moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    place = ephem.Observer()
    place.lat, place.lon, place.date = latitude, longitude, ephem.Date(moment.replace(tzinfo=None))
    place.pressure = 0.0
    sun = ephem.Sun(place)
    if sun.alt > REFRACTED:
        place.pressure = PRESSURE
        sun = ephem.Sun(place)
    if sun.alt < TWILIGHT:
        raise SettingError(
            f"at {time} the sun is {-math.degrees(sun.alt):.0f} degrees below the horizon there: it is night; give another time"
        )
    return Light(azimuth=math.pi / 2 - float(sun.az), elevation=float(sun.alt), clouds=clouds, latitude=latitude)


OVERCAST = partial(Light, clouds=1.0)
LIGHTS = Registry(
    "lights",
    "light",
    {"sun": f"{__name__}:Light", "overcast": f"{__name__}:OVERCAST", "daylight": f"{__name__}:daylight"},
)


def light_spec(value: Any) -> Spec | None:
    """The spec of a light from a text, a spec or a `Light`. None is the light in a world's own colours. Raises SettingError."""
    if value is None or isinstance(value, Spec):
        return value
    if not isinstance(value, str | Light):
        raise SettingError(
            f"the light is of type {type(value).__name__}; give a Light, or a text such as 'sun azimuth_deg=90'"
        )
    spec = LIGHTS.spec(value) if isinstance(value, str) else LIGHTS.spec_of(value)
    if not isinstance(spec.make(), Light):  # refuses bad parameters, too
        raise SettingError(f"{str(spec)!r} is not a light; name one, such as 'sun azimuth_deg=90 elevation_deg=30'")
    return spec
