"""Window estimates from stored samples, and their distribution by brute force."""

from __future__ import annotations

import math

import numpy as np


def stored_estimates(samples, window_s, sample_s):
    """Mean and mean square of all samples of a channel, in the order they were taken."""
    mean = square = 0.0
    for number, value in enumerate(samples, start=1):
        weight = max(1.0 / number, 1.0 - math.exp(-sample_s / window_s))
        mean = (1.0 - weight) * mean + weight * value
        square = (1.0 - weight) * square + weight * value * value
    return mean, square


def dense_distribution(weights, sample_s, correlation_s):
    """Variance of the weighted mean, and eigenvalues of the weighted mean square, from the whole matrix."""
    count = len(weights)
    matrix = np.array([[math.exp(-abs(i - j) * sample_s / correlation_s) for j in range(count)] for i in range(count)])
    variance = sum(weights[i] * weights[j] * matrix[i, j] for i in range(count) for j in range(count))
    return variance, np.linalg.eigvals(matrix @ np.diag(weights)).real


def correlated(rng, count, shape, sample_s, correlation_s):
    """Gaussian samples (count, *shape) of unit variance, correlated like exp(-t / correlation)."""
    rho = math.exp(-sample_s / correlation_s)
    values = rng.normal(size=(count, *shape))
    for number in range(1, count):
        values[number] = rho * values[number - 1] + math.sqrt(1.0 - rho**2) * values[number]
    return values
