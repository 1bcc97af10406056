"""Weights, projections and sigmas of every processing mode, written out from the published formulas.

Second formulation of what the receiver's compiled loops make; it imports nothing of the suite.
"""

from __future__ import annotations

import numpy as np

F1_HZ, F5_HZ = 1575.42e6, 1176.45e6
IF_1 = F1_HZ**2 / (F1_HZ**2 - F5_HZ**2)
IF_5 = -(F5_HZ**2) / (F1_HZ**2 - F5_HZ**2)
ROOT = np.sqrt(100.0 / 30.0)


def air_l1(theta_deg: np.ndarray, tau_s: float, aad: str = "A") -> np.ndarray:
    """AAD noise and airframe multipath of 100 s smoothing; sqrt(100/30) more for 30 s."""
    a0, a1, theta0 = (0.15, 0.43, 6.9) if aad == "A" else (0.11, 0.13, 4.0)
    noise = a0 + a1 * np.exp(-theta_deg / theta0)
    multipath = 0.13 + 0.53 * np.exp(-theta_deg / 10.0)
    return np.sqrt(noise**2 + multipath**2) * (1.0 if tau_s == 100.0 else ROOT)


def air_l5(theta_deg: np.ndarray, tau_s: float) -> np.ndarray:
    """Surrogate of L5 and E5a: 30 s has sqrt(100/30) the noise and 1.2 times the multipath."""
    noise = 0.06 + 0.05 * np.exp(-theta_deg / 6.0)
    multipath = 0.08 + 0.2 * np.exp(-theta_deg / 10.0)
    return np.hypot(noise, multipath) if tau_s == 100.0 else np.hypot(ROOT * noise, 1.2 * multipath)


def iono(theta_rad: np.ndarray, sigma_vig: float, distance_m: float, speed_mps: float, tau_s: float) -> np.ndarray:
    """F_pp sigma_vig (x + 2 tau v) on L1."""
    obliquity = 1.0 / np.sqrt(1.0 - (6378136.3 * np.cos(theta_rad) / (6378136.3 + 350000.0)) ** 2)
    return obliquity * sigma_vig * (distance_m + 2.0 * tau_s * speed_mps)


def projection(los: np.ndarray, sigma_m: np.ndarray, clocks: np.ndarray) -> np.ndarray:
    """S = (G^T W G)^-1 G^T W with G = [-e, clock...]; lines of sight (3, n), clocks (k, n) of ones and zeros."""
    design = np.vstack([-los, clocks[clocks.any(axis=1)]]).T
    weight = np.diag(1.0 / sigma_m**2)
    return np.linalg.inv(design.T @ weight @ design) @ design.T @ weight
