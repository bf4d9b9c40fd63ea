"""Runs a `.usda` or `.usdc` of linear curves in Newton for some steps: python newton_run.py FILE [steps]

Yarns hang in the air without gravity, hold each other by contact, and are watched at each step: no yarn may pass through another.
"""

import sys

import newton
import numpy as np
import warp as wp

STEP = 1e-3  # s


def segments(state, shapes, bodies):
    """Both ends of each segment, which Newton has as a capsule along z."""
    q = state.body_q.numpy()[bodies]
    x, y, z, w = q[:, 3], q[:, 4], q[:, 5], q[:, 6]
    axis = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    half = axis * shapes[:, 1:2]
    return q[:, :3] - half, q[:, :3] + half


def sides(a, b, pairs):
    """On which side of one segment the other passes, and 0 where they don't pass each other; and how far apart they are."""
    u, v = (b - a)[pairs[:, 0]], (b - a)[pairs[:, 1]]
    d = a[pairs[:, 1]] - a[pairs[:, 0]]
    n = np.cross(u, v)
    square = np.maximum((n * n).sum(1), 1e-30)
    s = (np.cross(d, v) * n).sum(1) / square
    t = (np.cross(d, u) * n).sum(1) / square
    inside = (s > 0) & (s < 1) & (t > 0) & (t < 1)
    height = (d * n).sum(1) / np.sqrt(square)
    return np.where(inside, np.sign(height), 0), np.where(inside, np.abs(height), np.inf)


def main():
    path, steps = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 100
    wp.config.quiet = True
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    builder.add_usd(path)
    collide = sum(bool(flags & newton.ShapeFlags.COLLIDE_SHAPES) for flags in builder.shape_flags)
    print(f"{path}: {builder.body_count} bodies, {builder.joint_count} joints, {collide} shapes that collide, {sum(builder.body_mass) * 1e6:.3f} mg")
    assert builder.body_count and collide == builder.shape_count
    # Newton looks for contacts a tenth of a metre around, unless it is told the size of things.
    builder.rigid_gap = 0.0
    builder.shape_gap = [0.2 * scale[0] for scale in builder.shape_scale]
    builder.color()
    model = builder.finalize(device="cpu")
    bodies, scale = model.shape_body.numpy(), model.shape_scale.numpy()
    # Far from each other at first is far for 100 short steps.
    a, b = segments(model.state(), scale, bodies)
    middle = (a + b) / 2
    reach = 2 * scale[:, 1].max() + 6 * scale[:, 0].max()
    near = np.argwhere(np.triu(np.linalg.norm(middle[:, None] - middle[None], axis=2) < reach, 2))
    solver = newton.solvers.SolverVBD(model, iterations=20)
    now, then = model.state(), model.state()
    control, contacts = model.control(), model.contacts()
    before, apart = sides(a, b, near)
    print(f"at first axes are at least {apart.min() / (2 * scale[:, 0].max()):.2f} diameters apart")
    nearest, crossed, moved = np.inf, 0, 0.0
    for _ in range(steps):
        now.clear_forces()
        model.collide(now, contacts)
        solver.step(now, then, control, contacts, STEP)
        now, then = then, now
        a, b = segments(now, scale, bodies)
        after, apart = sides(a, b, near)
        crossed += int(((before * after) < 0).sum())
        before = np.where(after == 0, before, after) * (after != 0)
        nearest = min(nearest, apart.min())
        moved = np.linalg.norm((a + b) / 2 - middle, axis=1).max()
    assert np.isfinite(moved)
    print(f"{steps} steps of {STEP:g} s: {crossed} crossings, axes at least {nearest / (2 * scale[:, 0].max()):.2f} diameters apart, points moved {moved * 1e3:.3f} mm at most")
    assert crossed == 0 and moved < 1e-2


if __name__ == "__main__":
    sys.exit(main())
