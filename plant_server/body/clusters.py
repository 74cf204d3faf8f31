"""Accelerations of links, each on its own or held together by brakes.

    A x = b        A the mass matrix of link orientations, positive; b the forces on them

A brake holds a link to the one below it, the lowest brake to the ground: the links between two
free joints are one rigid *cluster* and turn alike, those that are held to the ground not at all.
With x = P u, where P has one column per cluster, d'Alembert's principle gives

    P^T A P u = P^T b

so rows, columns and forces are summed over clusters, and those of the ground are left out. The
brake takes the coordinate away instead of pulling at it: nothing is stiff, nothing drifts. The
same equations with momenta for b are those of a plastic impact, which turns rates at once.
"""

from collections.abc import Sequence

GROUND = -1
"""The cluster of the links that are held to the ground."""


def clusters(braked: Sequence[bool]) -> list[int]:
    """The cluster of each link, from the ground up, for the brakes of the joints below them."""
    numbers = []
    number = GROUND
    for held in braked:
        if not held:
            number += 1
        numbers.append(number)
    return numbers


def solve_held(
    lower: Sequence[Sequence[float]], right: Sequence[float], cluster_of: Sequence[int]
) -> list[float]:
    """Solve A x = b with one x per cluster and none for the ground; A by its lower triangle.

    With every link a cluster of its own it is `solve`, to the bit.
    """
    size = cluster_of[-1] + 1
    matrix = [[0.0] * (i + 1) for i in range(size)]
    forces = [0.0] * size
    for i, into in enumerate(cluster_of):
        if into == GROUND:
            continue
        forces[into] += right[i]
        row = matrix[into]
        for j in range(i + 1):
            other = cluster_of[j]
            if other == GROUND:
                continue
            # Off the diagonal, the triangle's entry stands for its mirror image too.
            row[other] += 2.0 * lower[i][j] if other == into and j < i else lower[i][j]
    solution = solve(matrix, forces)
    return [0.0 if into == GROUND else solution[into] for into in cluster_of]


def solve(lower: list[list[float]], right: list[float]) -> list[float]:
    """Solve A x = b by L D L^T, for positive A given by its lower triangle; overwrites both."""
    n = len(right)
    pivots: list[float] = []
    for i in range(n):
        row = lower[i]
        total = right[i]
        pivot = row[i]
        for j in range(i):
            scaled = row[j]
            other = lower[j]
            for k in range(j):
                scaled -= row[k] * other[k]
            row[j] = scaled
        for j in range(i):
            scaled = row[j]
            row[j] = factor = scaled / pivots[j]
            pivot -= scaled * factor
            total -= factor * right[j]
        pivots.append(pivot)
        right[i] = total
    for i in range(n - 1, -1, -1):
        total = right[i] / pivots[i]
        for k in range(i + 1, n):
            total -= lower[k][i] * right[k]
        right[i] = total
    return right


def differences(thetas: list[float]) -> list[float]:
    """Joint values from those of the links; overwrites them. Of links held together: exactly 0."""
    for i in range(len(thetas) - 1, 0, -1):
        thetas[i] -= thetas[i - 1]
    return thetas


def product(lower: Sequence[Sequence[float]], vector: Sequence[float]) -> list[float]:
    """A x, for symmetric A given by its lower triangle."""
    result: list[float] = []
    for i, row in enumerate(lower):
        total = row[i] * vector[i]
        for j in range(i):
            total += row[j] * vector[j]
            result[j] += row[j] * vector[i]
        result.append(total)
    return result
