"""Selection of NSGA-II: fronts without dominance, and crowding distances.

Source: K. Deb, A. Pratap, S. Agarwal and T. Meyarivan, *A fast and elitist multiobjective genetic
algorithm: NSGA-II* (IEEE Transactions on Evolutionary Computation 6:182, 2002), section III.
"""

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray, IndexArray


def ranks(objectives: FloatArray) -> IndexArray:
    """Returns the front of each solution, ``(n,)``: 0 for a solution that no other dominates.

    Args:
        objectives: Finite values to be maximised, ``(n, objectives)``.
    """
    no_worse = (objectives[:, np.newaxis] >= objectives).all(axis=-1)
    better = (objectives[:, np.newaxis] > objectives).any(axis=-1)
    dominates: BoolArray = np.asarray(no_worse & better)
    found = np.full(len(objectives), -1, dtype=np.intp)
    front = 0
    while (left := found < 0).any():
        found[left & ~dominates[left].any(axis=0)] = front
        front += 1
    return found


def crowding(objectives: FloatArray, fronts: IndexArray) -> FloatArray:
    """Returns the crowding distance of each solution in its front, infinite at its ends, ``(n,)``.

    Args:
        objectives: Finite values, ``(n, objectives)``.
        fronts: Front of each solution, ``(n,)``.
    """
    distances = np.zeros(len(objectives))
    for front in range(int(fronts.max()) + 1):
        own = np.flatnonzero(fronts == front)
        for column in objectives[own].T:
            order = own[np.argsort(column, kind="stable")]
            values = np.sort(column)
            spread = values[-1] - values[0]
            distances[order[[0, -1]]] = np.inf
            if spread > 0:
                distances[order[1:-1]] += (values[2:] - values[:-2]) / spread
    return distances


def best_first(objectives: FloatArray) -> IndexArray:
    """Returns the indices of the solutions, by front and then by crowding distance, ``(n,)``."""
    fronts = ranks(objectives)
    return np.lexsort((-crowding(objectives, fronts), fronts))
