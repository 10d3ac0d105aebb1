#version 330 core
// Texture times corner colours, in linear light; holes where alpha is too low. See world/textures.py.

struct Material {
    vec4 base_color_factor; // its alpha is the least alpha that is seen
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
#ifdef HAS_EMISSIVE_TEX
    sampler2D emissive_texture; // no light: how far the ray of each pixel is from its middle (Cubemap.ray_offsets), plus 1/2
#endif
};

uniform Material material;

#ifdef HAS_BASE_COLOR_TEX
in vec2 uv;
#endif
#ifdef COLOR_0_LOC
in vec4 between_corners;
#endif

out vec4 frag_color;

vec3 to_linear(vec3 display)
{
    vec3 high = pow((display + 0.055) / 1.055, vec3(2.4));
    return mix(high, display / 12.92, lessThanEqual(display, vec3(0.04045)));
}

vec3 to_display(vec3 linear)
{
    vec3 high = 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055;
    return mix(high, linear * 12.92, lessThanEqual(linear, vec3(0.0031308)));
}

// What is linear across a triangle, where the ray of this pixel meets it. Divided by the distance, it is linear in the image.
vec4 at_ray(vec4 value)
{
#ifdef HAS_EMISSIVE_TEX
    vec2 offset = texelFetch(material.emissive_texture, ivec2(gl_FragCoord.xy), 0).xy - 0.5;
    float w = gl_FragCoord.w;
    vec4 moved = value * w + dFdx(value * w) * offset.x + dFdy(value * w) * offset.y;
    return moved / (w + dFdx(w) * offset.x + dFdy(w) * offset.y);
#else
    return value;
#endif
}

void main()
{
#ifdef COLOR_0_LOC
    vec4 corner_colour = clamp(at_ray(between_corners), 0.0, 1.0);
#endif
#ifdef HAS_BASE_COLOR_TEX
    vec4 colour = texture(material.base_color_texture, at_ray(vec4(uv, 0.0, 0.0)).xy);
#ifdef COLOR_0_LOC
    colour = vec4(to_display(to_linear(colour.rgb) * to_linear(corner_colour.rgb)), colour.a * corner_colour.a);
#endif
    if (colour.a < material.base_color_factor.a)
        discard;
#else
    vec4 colour = corner_colour;
#endif
    frag_color = vec4(clamp(colour.rgb, 0.0, 1.0), 1.0);
}
