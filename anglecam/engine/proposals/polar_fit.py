"""Frames about one centre, in polar coordinates, as a still part and a part that turns.

    X_k(r, m) = S(r, m) + T(r, m)·e^{−imφ_k}

X_k is frame k less the median of the frames, r the radius, m the order of the Fourier series over the angle, and φ_k
the turn. Given the turns, S and T follow from linear equations for each r and m. S takes what the median contains of
the body, so that small swings need nothing special. What a frame looks like when S and T are learnt without it, and
which turn fits it best then, follows from its leverage.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from anglecam.data.typing import Floats

Array = NDArray[np.float32]


@numba.njit(
    "float32[:, :, ::1](float32[:, :, ::1], float32[::1], float32[::1], int64)", cache=True, nogil=True, fastmath=True
)
def to_polar(pictures: Array, centre: Array, radii: Array, angles: int) -> Array:
    """Return pictures (h, w, K) at angles and radii about a centre (2,), as (angles, R, K); 0 outside."""
    height, width, count = pictures.shape
    result = np.zeros((angles, len(radii), count), np.float32)
    for i in range(angles):
        cos, sin = np.cos(2.0 * np.pi * i / angles), np.sin(2.0 * np.pi * i / angles)
        for j in range(len(radii)):
            x, y = centre[0] + radii[j] * cos, centre[1] + radii[j] * sin
            left, top = int(np.floor(x)), int(np.floor(y))
            if left < 0 or top < 0 or left >= width - 1 or top >= height - 1:
                continue
            u, v = np.float32(x - left), np.float32(y - top)
            a, b = (np.float32(1) - u) * (np.float32(1) - v), u * (np.float32(1) - v)
            c, d = (np.float32(1) - u) * v, u * v
            for k in range(count):
                result[i, j, k] = (
                    a * pictures[top, left, k]
                    + b * pictures[top, left + 1, k]
                    + c * pictures[top + 1, left, k]
                    + d * pictures[top + 1, left + 1, k]
                )
    return result


@numba.njit(
    "UniTuple(float32[:, ::1], 3)(float32[:, :, ::1], float32[:, :, ::1], int64[::1], float32[::1], float32[:, ::1])",
    cache=True,
    nogil=True,
    fastmath=True,
)
def fit(re: Array, im: Array, most: NDArray[np.int64], turn: Array, weight: Array) -> tuple[Array, Array, Array]:
    """Learn S and T from all frames, and compare each frame with what the others predict.

    Parameters
    ----------
    re, im : (M, R, K) ndarray
        X.
    most : (R,) ndarray
        Highest m to use.
    turn : (K,) ndarray
        φ, rad.
    weight : (R, K) ndarray
        Of each ring of each frame.

    Returns
    -------
    left : (R, K) ndarray
        Σ_m |X − its prediction from the other frames|².
    match_re, match_im : (M, K) ndarray
        Σ_r weight·T*·(X − S), where S and T are learnt from the other frames: the series whose value at an angle is how
        well the frame matches when it is turned by it.
    """
    many, rings, count = re.shape
    left = np.zeros((rings, count), np.float32)
    match_re = np.zeros((many, count), np.float32)
    match_im = np.zeros((many, count), np.float32)
    for i in range(many):
        order = np.float32(i + 1)
        cos, sin = np.cos(order * turn), np.sin(order * turn)  # z = cos − i·sin
        for j in range(rings):
            if order > most[j]:
                continue
            a = c_re = c_im = p_re = p_im = q_re = q_im = np.float32(0)
            for k in range(count):
                w, x, y = weight[j, k], re[i, j, k], im[i, j, k]
                a += w
                c_re += w * cos[k]
                c_im -= w * sin[k]
                p_re += w * x
                p_im += w * y
                q_re += w * (x * cos[k] - y * sin[k])
                q_im += w * (x * sin[k] + y * cos[k])
            if a == 0.0:
                continue
            a += a / count  # keeps the equations solvable
            det = a * a - c_re * c_re - c_im * c_im
            s_re = (a * p_re - c_re * q_re + c_im * q_im) / det
            s_im = (a * p_im - c_re * q_im - c_im * q_re) / det
            t_re = (a * q_re - c_re * p_re - c_im * p_im) / det
            t_im = (a * q_im - c_re * p_im + c_im * p_re) / det
            for k in range(count):
                w = weight[j, k]
                e_re = re[i, j, k] - s_re - t_re * cos[k] - t_im * sin[k]
                e_im = im[i, j, k] - s_im - t_im * cos[k] + t_re * sin[k]
                g_re = (a - c_re * cos[k] + c_im * sin[k]) / det  # of S: (a − C·z*)/det
                h_re = (a * cos[k] - c_re) / det  # of T: (a·z* − C*)/det
                h_im = (a * sin[k] + c_im) / det
                held = w * (g_re + h_re * cos[k] + h_im * sin[k])
                e_re /= np.float32(1) - held
                e_im /= np.float32(1) - held
                left[j, k] += e_re * e_re + e_im * e_im
                u_re = t_re - w * (h_re * e_re - h_im * e_im)
                u_im = t_im - w * (h_re * e_im + h_im * e_re)
                # X − S of the other frames is their prediction of the turning part and the error
                y_re = u_re * cos[k] + u_im * sin[k] + e_re
                y_im = u_im * cos[k] - u_re * sin[k] + e_im
                match_re[i, k] += w * (u_re * y_re + u_im * y_im)
                match_im[i, k] += w * (u_re * y_im - u_im * y_re)
    return left, match_re, match_im


@numba.njit("int64[::1](float32[:, ::1], float64)", cache=True, nogil=True)
def steady_path(match: Array, cost: float) -> NDArray[np.int64]:
    """Return the path over angles (K,) with the highest match (angles, K), less ``cost`` for each bin of turn."""
    count, frames = match.shape
    best = match[:, 0].copy()
    come = np.zeros((frames, count), np.int64)
    for k in range(1, frames):
        source = np.arange(count)
        for _ in range(2):  # twice around, as the angles close
            for i in range(count):
                j = (i - 1) % count
                if best[j] - cost > best[i]:
                    best[i], source[i] = best[j] - cost, source[j]
            for i in range(count - 1, -1, -1):
                j = (i + 1) % count
                if best[j] - cost > best[i]:
                    best[i], source[i] = best[j] - cost, source[j]
        come[k] = source
        best = best + match[:, k]
    path = np.zeros(frames, np.int64)
    path[-1] = best.argmax()
    for k in range(frames - 1, 0, -1):
        path[k - 1] = come[k, path[k]]
    return path


@numba.njit(
    "float64[::1](float32[::1], float32[::1], float32[::1], float64[:, ::1])",
    cache=True,
    nogil=True,
    fastmath=True,
)
def roundness(x: Array, y: Array, value: Array, centres: Floats) -> Floats:
    """Return the share of the variance of values at pixels that rings about each of (n, 2) centres explain."""
    mean = value.mean()
    total = ((value - mean) ** 2).sum()
    result = np.zeros(len(centres))
    if total == 0.0:
        return result  # a single pixel has no rings
    for i in range(len(centres)):
        far = np.sqrt((x - centres[i, 0]) ** 2 + (y - centres[i, 1]) ** 2)
        count, inside = np.zeros(int(far.max()) + 2), np.zeros(int(far.max()) + 2)
        for j in range(len(x)):
            ring = int(far[j])
            outer = far[j] - ring
            count[ring] += 1.0 - outer
            count[ring + 1] += outer
            inside[ring] += (1.0 - outer) * (value[j] - mean)
            inside[ring + 1] += outer * (value[j] - mean)
        explained = (inside**2 / np.maximum(count, 1e-6)).sum() / total
        free = len(x) - (count > 0.5).sum()
        result[i] = 1.0 - (1.0 - explained) * len(x) / max(free, 1)
    return result
