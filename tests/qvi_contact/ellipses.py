"""A quarter of a plate with an elliptic hole, Kirsch's and Inglis' problem, between two confocal ellipses.

Both are images of circles, z = ζ + m/ζ with |ζ| = 1 and |ζ| = FAR. Tension 1 from all sides far away has the potentials
(Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, § 82a)

    φ = (ζ − m/ζ)/2,   ψ = −(1 + m²) ζ/(ζ² − m)
"""

import numpy as np

from qvi_contact import ContactProblem, Material, Symmetry, Traction, TriangleMesh

M, FAR, NU = 0.25, 2.0, 0.3


def place(zeta):
    return zeta + M / zeta


def stress_at(zeta):
    """σ_xx, σ_yy, σ_xy (..., 3) at the places of ζ."""
    zeta = np.asarray(zeta, dtype=complex)
    z, slope, bend = place(zeta), 1.0 - M / zeta**2, 2.0 * M / zeta**3
    one, two = (1.0 + M / zeta**2) / 2.0, -M / zeta**3
    phi = one / slope
    phi_z = (two * slope - one * bend) / slope**3
    psi = (1.0 + M**2) * (zeta**2 + M) / (zeta**2 - M) ** 2 / slope
    trace, deviator = 4.0 * phi.real, 2.0 * (np.conj(z) * phi_z + psi)
    return np.stack([(trace - deviator.real) / 2.0, (trace + deviator.real) / 2.0, deviator.imag / 2.0], axis=-1)


def zeta_of(x, y):
    z = x + 1j * np.asarray(y)
    root = np.sqrt(z**2 - 4.0 * M + 0j)
    return (z + np.where((root * np.conj(z)).real < 0.0, -root, root)) / 2.0


def stress(x, y):
    return stress_at(zeta_of(x, y))


def traction(component):
    """A component of the traction on the outer ellipse."""

    def value(x, y):
        zeta = zeta_of(x, y)
        normal = zeta * (1.0 - M / zeta**2)
        normal = normal / np.abs(normal)
        xx, yy, xy = np.moveaxis(stress_at(zeta), -1, 0)
        return (xx, xy)[component] * normal.real + (xy, yy)[component] * normal.imag

    return value


def ellipse(radius):
    """The image of a circle, by its angle."""

    def curve(angle):
        z = place(radius * np.exp(1j * angle))
        return np.column_stack([z.real, z.imag])

    return curve


def plate(radial, around, *, curved=True):
    """The quarter, cut into triangles."""
    r, angle = np.meshgrid(np.geomspace(1.0, FAR, radial + 1), np.linspace(0.0, np.pi / 2.0, around + 1))
    z = place(r * np.exp(1j * angle)).ravel()
    vertices = np.column_stack([z.real, z.imag])
    vertices[np.abs(vertices) < 1e-14] = 0.0
    number = np.arange(len(vertices)).reshape(r.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    cells = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    lines = {"hole": number[:, 0], "outer": number[:, -1], "bottom": number[0], "left": number[-1]}
    mesh = TriangleMesh(vertices, cells, {name: np.column_stack([line[:-1], line[1:]]) for name, line in lines.items()})
    if not curved:
        return mesh
    return mesh.with_curve("hole", ellipse(1.0), 0.0, np.pi / 2.0).with_curve("outer", ellipse(FAR), 0.0, np.pi / 2.0)


def stretched(mesh):
    conditions = [
        Traction("hole", normal=0.0, tangential=0.0),
        Traction("outer", x=traction(0), y=traction(1)),
        Symmetry("bottom"),
        Symmetry("left"),
    ]
    return ContactProblem(mesh, Material(1.0, NU), conditions)


def energy():
    """The strain energy of the quarter, by Gauss points of ζ in polar coordinates."""
    t, w = np.polynomial.legendre.leggauss(40)
    r, angle = np.meshgrid((1.0 + FAR) / 2.0 + (FAR - 1.0) / 2.0 * t, np.pi / 4.0 * (1.0 + t))
    weights = np.outer(w, w) * (FAR - 1.0) / 2.0 * np.pi / 4.0 * r
    zeta = r * np.exp(1j * angle)
    xx, yy, xy = np.moveaxis(stress_at(zeta), -1, 0)
    density = (xx**2 + yy**2 - 2.0 * NU * xx * yy + 2.0 * (1.0 + NU) * xy**2) / 2.0
    return float((weights * density * np.abs(1.0 - M / zeta**2) ** 2).sum())
