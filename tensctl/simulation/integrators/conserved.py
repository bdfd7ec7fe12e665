"""Momenta of a structure on which nothing acts from outside, kept where rounding would let them walk away.

    p = sum m c',   l = sum m (c - C) x c' + m/12 b x b',   J = sum m ((c - C)^2 - (c - C)(c - C)') + m/12 (b^2 - b b')
    c' += dp/M + w x (c - C),   b' += w x b,   J w = dl

Kicks and flights keep both exactly, but for rounding, which walks with the root of their number: 1e8 kicks lose 1e-12.
What is missing is given back by the rates of least kinetic energy that carry it, those of a rigid body (C, M: mass
centre and mass).
"""

from __future__ import annotations

from tensctl.jit import bare, part

# Below this share of trace(J)^3, det J is that of rods in one line, which cannot be given a rate about it.
_IN_LINE = 1e-9


@part
def alone(rows, load):
    """Whether nothing acts from outside: no end is held, no tendon ends on the ground, no node is loaded."""
    if rows.held or rows.size > 6 * rows.row:
        return False
    loaded = 0.0
    for i in range(load.size):
        loaded = max(loaded, abs(load[i]))
    return loaded == 0.0


@bare
def middle(rows, q):
    """Mass, and mass centre or its velocity, three numbers: q1 is twice a rod's centre, and `centre` is 2/m."""
    n, mass, x, y, z = rows.row, 0.0, 0.0, 0.0, 0.0
    for r in range(rows.rods):
        m = 2.0 / rows.centre[r]
        mass, x, y, z = mass + m, x + m * q[r], y + m * q[n + r], z + m * q[2 * n + r]
    return mass, x / (2.0 * mass), y / (2.0 * mass), z / (2.0 * mass)


@bare
def momenta_of(rows, q, v):
    """p, kg m/s, and l about the mass centre, kg m^2/s: six numbers."""
    n, lx, ly, lz = rows.row, 0.0, 0.0, 0.0
    _, cx, cy, cz = middle(rows, q)
    mass, ux, uy, uz = middle(rows, v)
    for r in range(rows.rods):
        m = 2.0 / rows.centre[r]
        x, y, z = 0.5 * q[r] - cx, 0.5 * q[n + r] - cy, 0.5 * q[2 * n + r] - cz
        a, b, d = 0.5 * v[r] - ux, 0.5 * v[n + r] - uy, 0.5 * v[2 * n + r] - uz
        e, f, g = q[3 * n + r], q[4 * n + r], q[5 * n + r]
        s, t, w = v[3 * n + r] / 12.0, v[4 * n + r] / 12.0, v[5 * n + r] / 12.0
        lx += m * ((y * d - z * b) + (f * w - g * t))
        ly += m * ((z * a - x * d) + (g * s - e * w))
        lz += m * ((x * b - y * a) + (e * t - f * s))
    return mass * ux, mass * uy, mass * uz, lx, ly, lz


@bare
def turning(rows, q, lx, ly, lz):
    """Angular velocity w, rad/s, of the rigid structure with an angular momentum; zero where all rods lie in line."""
    n, xx, yy, zz, xy, xz, yz = rows.row, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    _, cx, cy, cz = middle(rows, q)
    for r in range(rows.rods):
        m = 2.0 / rows.centre[r]
        x, y, z = 0.5 * q[r] - cx, 0.5 * q[n + r] - cy, 0.5 * q[2 * n + r] - cz
        e, f, g = q[3 * n + r], q[4 * n + r], q[5 * n + r]
        xx, yy, zz = xx + m * (x * x + e * e / 12.0), yy + m * (y * y + f * f / 12.0), zz + m * (z * z + g * g / 12.0)
        xy, xz, yz = xy + m * (x * y + e * f / 12.0), xz + m * (x * z + e * g / 12.0), yz + m * (y * z + f * g / 12.0)
    jx, jy, jz = yy + zz, xx + zz, xx + yy
    # Cofactors of J = ((jx, -xy, -xz), (-xy, jy, -yz), (-xz, -yz, jz)).
    ax, ay, az = jy * jz - yz * yz, jx * jz - xz * xz, jx * jy - xy * xy
    bxy, bxz, byz = xy * jz + xz * yz, xy * yz + xz * jy, jx * yz + xy * xz
    det = jx * ax - xy * bxy - xz * bxz
    if not det > _IN_LINE * (jx + jy + jz) ** 3:
        return 0.0, 0.0, 0.0
    x, y, z = ax * lx + bxy * ly + bxz * lz, bxy * lx + ay * ly + byz * lz, bxz * lx + byz * ly + az * lz
    return x / det, y / det, z / det


@bare
def give_back(rows, q, v, momenta):
    """Change rates so that momenta are again what `momenta_of` said."""
    n = rows.row
    px, py, pz, lx, ly, lz = momenta_of(rows, q, v)
    mass, cx, cy, cz = middle(rows, q)
    a, b, d = turning(rows, q, momenta[3] - lx, momenta[4] - ly, momenta[5] - lz)
    px, py, pz = 2.0 * (momenta[0] - px) / mass, 2.0 * (momenta[1] - py) / mass, 2.0 * (momenta[2] - pz) / mass
    for r in range(rows.rods):
        x, y, z = q[r] - 2.0 * cx, q[n + r] - 2.0 * cy, q[2 * n + r] - 2.0 * cz
        v[r] += px + (b * z - d * y)
        v[n + r] += py + (d * x - a * z)
        v[2 * n + r] += pz + (a * y - b * x)
        e, f, g = q[3 * n + r], q[4 * n + r], q[5 * n + r]
        v[3 * n + r] += b * g - d * f
        v[4 * n + r] += d * e - a * g
        v[5 * n + r] += a * f - b * e
