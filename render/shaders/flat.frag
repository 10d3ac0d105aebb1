#version 330 core
// Texture times corner colours, in linear light; holes where alpha is too low. See world/textures.py.

struct Material {
    vec4 base_color_factor; // its alpha is the least alpha that is seen
#ifdef HAS_BASE_COLOR_TEX
    sampler2D base_color_texture;
#endif
};

uniform Material material;

#ifdef HAS_BASE_COLOR_TEX
in vec2 uv;
#endif
#ifdef COLOR_0_LOC
in vec4 corner_colour;
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

void main()
{
#ifdef HAS_BASE_COLOR_TEX
    vec4 colour = texture(material.base_color_texture, uv);
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
