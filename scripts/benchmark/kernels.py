"""The batched log-posterior of one record three times: numpy as in the package, numba, numexpr.

The other two are written for speed on one record in one sweep with independent or AR(1) noise. They are compared with
the package's own before they are timed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from benchmark.gradient_posterior import HALF_LN_2PI, ROOT_HALF, Form, numbers

from sma_bayes.arrays import Floats
from sma_bayes.fitting.posterior import Posterior

Kernel = Callable[[Floats], Floats]


def numpy_kernel(posterior: Posterior) -> Kernel:
    """The package's own."""
    return posterior.log_prob


def numexpr_kernel(posterior: Posterior) -> Kernel:
    """Residuals by numexpr, one expression a channel; priors and sums of AR(1) by numpy."""
    import numexpr

    numexpr.set_num_threads(1)
    (record,) = posterior.records
    space = posterior.space
    remembers = posterior.noise.name == "ar1"
    column = {name: i for i, name in enumerate(posterior.names)}
    written = {
        "force": "(y - B4 - B1/(1 + exp(-B2*(t - B3))))/sd",
        "displacement": "(y - A4 - A1/(1 + exp(-A2*(t - A3))))/sd",
        "stiffness": "(y - B1*B2/(A1*A2)*exp(abs(A2*(t-A3)) + 2*log1p(exp(-abs(A2*(t-A3))))"
        " - abs(B2*(t-B3)) - 2*log1p(exp(-abs(B2*(t-B3))))))/sd",
    }

    def log_prob(z: Floats) -> Floats:
        total = space.log_prior(z)
        theta = space.constrain(z)
        values = {name: theta[:, i, None] for name, i in column.items()}
        for channel in record.channels:
            sd = values[f"{channel}_sd"]
            known = {**values, "t": record.temperature, "y": record.observed[channel], "sd": sd}
            total -= record.n * (np.log(sd[:, 0]) + HALF_LN_2PI)
            if remembers:
                e = numexpr.evaluate(written[channel], local_dict=known)
                shape = theta[:, column[f"{channel}_phi"], None]
                total += posterior.noise.total_log_density(e, shape, posterior.steps[0])
                total += record.n * HALF_LN_2PI
            else:
                expression = f"sum(({written[channel]})**2, axis=1)"
                total -= 0.5 * numexpr.evaluate(expression, local_dict=known)
        return total

    return log_prob


def numba_kernel(posterior: Posterior) -> Kernel:
    """One compiled loop over parameter vectors and samples."""
    form = Form.of(posterior)
    (record,) = posterior.records
    data = numbers(posterior, record.n)
    at = {name: i for i, name in enumerate(form.names)}
    kind = np.array([2 if b else int(g) for g, b in zip(form.logarithmic, form.bounded, strict=True)])
    stiffness = form.channels == ("stiffness",)
    places = []
    for channel in form.channels:
        letter = "B" if channel == "force" else "A"
        names = ["A1", "A2", "A3", "B1", "B2", "B3"] if stiffness else [f"{letter}{i}" for i in (1, 2, 3, 4)]
        noise = [f"{channel}_sd", f"{channel}_phi"] if form.autocorrelated else [f"{channel}_sd"]
        places.append([at[name] for name in names + noise])
    observed = np.stack([data[channel] for channel in form.channels])
    loop = _compiled_loop()
    arguments = (
        np.array(places), kind, data["first_of_prior"], data["second_of_prior"], data["sign"],
        data["temperature"], observed, stiffness, form.autocorrelated,
    )  # fmt: skip
    return lambda z: np.asarray(loop(np.ascontiguousarray(z), *arguments))


def _compiled_loop() -> Any:
    from numba import njit

    @njit(fastmath={"contract", "afn", "arcp", "nsz", "reassoc"}, error_model="numpy")
    def residual_squares(theta, p, t, y, stiffness, remembers, e):  # type: ignore[no-untyped-def]
        n = t.size
        if stiffness:
            a1, a2, a3, b1, b2, b3 = (
                theta[p[0]],
                theta[p[1]],
                theta[p[2]],
                theta[p[3]],
                theta[p[4]],
                theta[p[5]],
            )
            scale = b1 * b2 / (a1 * a2)
            for i in range(n):
                a, b = abs(a2 * (t[i] - a3)), abs(b2 * (t[i] - b3))
                q = (1.0 + math.exp(-a)) / (1.0 + math.exp(-b))
                e[i] = y[i] - scale * math.exp(a - b) * q * q
        else:
            size, rate, middle, offset = theta[p[0]], theta[p[1]], theta[p[2]], theta[p[3]]
            for i in range(n):
                e[i] = y[i] - offset - size / (1.0 + math.exp(-rate * (t[i] - middle)))
        squares = 0.0
        cross = 0.0
        for i in range(n):
            squares += e[i] * e[i]
        if remembers:
            for i in range(1, n):
                cross += e[i] * e[i - 1]
        return squares, cross

    @njit
    def loop(z, places, kind, first, second, sign, t, observed, stiffness, remembers):  # type: ignore[no-untyped-def]
        rows, d = z.shape
        out = np.empty(rows)
        e = np.empty(t.size)
        theta = np.empty(d)
        n = t.size
        for w in range(rows):
            total = 0.0
            for i in range(d):
                x = z[w, i]
                if kind[i] == 2:
                    theta[i] = first[i] + 0.5 * second[i] * math.erfc(-x * ROOT_HALF)
                    total -= 0.5 * x * x + HALF_LN_2PI
                else:
                    u = (x - first[i]) / second[i]
                    total -= 0.5 * u * u + math.log(second[i]) + HALF_LN_2PI
                    theta[i] = sign[i] * math.exp(x) if kind[i] == 1 else x
            for c in range(places.shape[0]):
                p = places[c]
                squares, cross = residual_squares(theta, p, t, observed[c], stiffness, remembers, e)
                k = 6 if stiffness else 4
                sd = theta[p[k]]
                if remembers:
                    phi = theta[p[k + 1]]
                    left = 1.0 - phi * phi
                    start, end = e[0] * e[0], e[n - 1] * e[n - 1]
                    follow = squares - start - 2.0 * phi * cross + phi * phi * (squares - end)
                    squares = start + follow / left
                    total -= 0.5 * (n - 1) * math.log(left)
                total -= n * (math.log(sd) + HALF_LN_2PI) + 0.5 * squares / (sd * sd)
            out[w] = total
        return out

    return loop


KERNELS: dict[str, Callable[[Posterior], Kernel]] = {
    "numpy": numpy_kernel,
    "numexpr": numexpr_kernel,
    "numba": numba_kernel,
}
