"""How the rig is lit: soft light from everywhere and two lamps, worked out at the vertices.

pyrender's own physically based shader works at every pixel and takes five times as long on a machine without a GPU.
The lamps stand still in the room, so the shade of the head changes as it turns, but little: most light is ambient.
"""

from __future__ import annotations

from pathlib import Path

AMBIENT = 0.66
LAMPS = (((0.24, 0.52, 0.82), 0.36), ((0.86, 0.17, 0.48), 0.12))
"""Direction from the rig to the lamp, of about unit length, and its strength."""

GAMMA = 2.2
"""Of the picture; light adds up before it, blending at edges happens after it, as grey levels."""

_VERTEX = """#version 330 core
layout(location = 0) in vec3 position;
layout(location = NORMAL_LOC) in vec3 normal;
layout(location = COLOR_0_LOC) in vec4 color_0;
layout(location = INST_M_LOC) in mat4 inst_m;
uniform mat4 M;
uniform mat4 V;
uniform mat4 P;
out vec3 shade;
void main()
{{
    mat4 pose = M * inst_m;
    gl_Position = P * V * pose * vec4(position, 1.0);
    vec3 n = normalize(mat3(pose) * normal);
    float light = {ambient} + {lamps};
    shade = clamp(pow(color_0.rgb * light, vec3({encode})), 0.0, 1.0);
}}
"""

_FRAGMENT = """#version 330 core
in vec3 shade;
out vec4 frag_color;
void main()
{
    frag_color = vec4(shade, 1.0);
}
"""


def write_shaders(folder: Path) -> None:
    """Write the two shaders under the names by which pyrender looks for its flat ones.

    Parameters
    ----------
    folder : Path
        An existing folder.
    """
    lamps = " + ".join(
        f"{strength} * max(dot(n, normalize(vec3({x}, {y}, {z}))), 0.0)" for (x, y, z), strength in LAMPS
    )
    vertex = _VERTEX.format(ambient=AMBIENT, lamps=lamps, encode=1 / GAMMA)
    (folder / "flat.vert").write_text(vertex, encoding="utf-8")
    (folder / "flat.frag").write_text(_FRAGMENT, encoding="utf-8")
