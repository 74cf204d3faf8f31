"""The equations of motion of one chain, written out: straight-line code for its number of links.

A chain of three spends most of its time on loops and lists. Written out for the links that it has,
the same floating-point operations in the same order take half the time, and give the same bits
(a test compares them). `Chain` stays the text to read; this is what runs.
"""

from collections.abc import Callable, Sequence

Accelerations = Callable[..., tuple[float, ...]]
Step = Callable[..., tuple[list[float], list[float]]]

LINKS_MAX = 8
"""Beyond this an articulated body is faster (`articulated`); the code grows with the
cube of the links."""


def accelerations(inertias: Sequence[Sequence[float]], weights: Sequence[float]) -> Accelerations:
    """Write out `Chain.accelerations_rad_s2`: a function of all q, then all q', then all tau.

    `inertias` is the lower triangle A_ij, `weights` is B_i g, as in `plant_server.body.chain`.
    """
    source = "\n    ".join(_lines(inertias, weights))
    names: dict[str, object] = {}
    exec(f"from math import cos, sin\n{source}", names)  # noqa: S102 - our own text, of numbers only
    return names["accelerations"]  # type: ignore[return-value]


def runge_kutta(accelerations: Accelerations, links: int) -> Step:
    """Write out a step of the classical fourth-order method, torques held.

    A function of all q, all q', all tau and the step in seconds, to the next q and q'.
    """
    source = "\n    ".join(_step_lines(links))
    names: dict[str, object] = {"accelerations": accelerations}
    exec(source, names)  # noqa: S102 - as above
    return names["step"]  # type: ignore[return-value]


def _step_lines(n: int) -> list[str]:
    def each(text: str) -> str:
        return ", ".join(text.replace("#", str(i)) for i in range(n))

    arguments = f"{each('q#')}, {each('v#')}, {each('t#')}"
    stages = [  # Accelerations a to d at q and v, then at three estimates of the rates: u, w, z.
        f"({each('a#')},) = accelerations({arguments})",
        f"({each('u#')},) = ({each('v# + half * a#')},)",
        f"({each('b#')},) = accelerations({each('q# + half * v#')}, {each('u#')}, {each('t#')})",
        f"({each('w#')},) = ({each('v# + half * b#')},)",
        f"({each('c#')},) = accelerations({each('q# + half * u#')}, {each('w#')}, {each('t#')})",
        f"({each('z#')},) = ({each('v# + h * c#')},)",
        f"({each('d#')},) = accelerations({each('q# + h * w#')}, {each('z#')}, {each('t#')})",
    ]
    angles = each("q# + sixth * (v# + 2.0 * (u# + w#) + z#)")
    rates = each("v# + sixth * (a# + 2.0 * (b# + c#) + d#)")
    return [
        f"def step({arguments}, h):",
        "half = 0.5 * h; sixth = h / 6.0",
        *stages,
        f"return [{angles}], [{rates}]",
    ]


def _lines(inertias: Sequence[Sequence[float]], weights: Sequence[float]) -> list[str]:
    n = len(weights)
    arguments = ", ".join(f"{name}{i}" for name in ("q", "v", "t") for i in range(n))
    lines = [f"def accelerations({arguments}):"]
    for i in range(n):
        lines += _link(i, n, inertias[i], weights[i])
    for i in range(n):
        lines += _eliminate(i)
    for i in reversed(range(n)):
        lines += _substitute(i, n)
    differences = ["x0", *(f"x{i} - x{i - 1}" for i in range(1, n))]
    return [*lines, f"return ({', '.join(differences)},)"]


def _link(i: int, n: int, inertias: Sequence[float], weight: float) -> list[str]:
    """Orientation of link i, its row of the mass matrix, its forces (`Chain._equations`)."""
    below = f"a{i - 1} + " if i else "0.0 + "
    above = f"t{i + 1}" if i < n - 1 else "0.0"
    lines = [
        f"a{i} = {below}q{i}",
        f"w{i} = {below.replace('a', 'w')}v{i}",
        f"s{i} = sin(a{i}); c{i} = cos(a{i}); z{i} = w{i} * w{i}",
        f"f{i} = t{i} - {above} + {weight!r} * s{i}",
    ]
    for j in range(i):
        lines += [
            f"k = {inertias[j]!r} * (s{i} * c{j} - c{i} * s{j})",
            f"m{i}_{j} = {inertias[j]!r} * (c{i} * c{j} + s{i} * s{j})",
            f"f{i} -= k * z{j}",
            f"f{j} += k * z{i}",
        ]
    return [*lines, f"m{i}_{i} = {inertias[i]!r}"]


def _eliminate(i: int) -> list[str]:
    """Row i of L D L^T and of the forward substitution (`clusters.solve`)."""
    lines = []
    for j in range(i):
        lines += [f"m{i}_{j} -= m{i}_{k} * m{j}_{k}" for k in range(j)]
    for j in range(i):
        lines += [
            f"g = m{i}_{j} / p{j}",
            f"m{i}_{i} -= m{i}_{j} * g",
            f"f{i} -= g * f{j}",
            f"m{i}_{j} = g",
        ]
    return [*lines, f"p{i} = m{i}_{i}"]


def _substitute(i: int, n: int) -> list[str]:
    """Row i of the backward substitution."""
    return [f"x{i} = f{i} / p{i}", *(f"x{i} -= m{k}_{i} * x{k}" for k in range(i + 1, n))]
