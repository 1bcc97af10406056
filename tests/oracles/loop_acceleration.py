"""Step, rate and acceleration of one channel by polynomial fits, channel by channel."""

from __future__ import annotations

import numpy as np


def loop_statistics(history, age_s, sigma):
    """{(receiver, band, satellite): (step, rate, acceleration)}, history newest first, no fault in the clocks' sets.

    Satellites with every epoch that the receiver has make its clock; the one looked at is left out of it.
    """
    found = {}
    n_epochs, n_receivers, n_bands, n_sats = history.shape
    for receiver in range(n_receivers):
        for band in range(n_bands):
            rows = history[:, receiver, band]
            epochs = [w for w in range(n_epochs) if np.isfinite(age_s[w]) and np.isfinite(rows[w]).any()]
            whole = [i for i in range(n_sats) if all(np.isfinite(rows[w, i]) for w in epochs)]
            for satellite in range(n_sats):
                if not np.isfinite(rows[0, satellite]):
                    continue
                others = [i for i in whole if i != satellite]
                weights = np.array([1.0 / sigma[receiver][band][i] ** 2 for i in others])
                weights /= weights.sum()
                own = [w for w in epochs if np.isfinite(rows[w, satellite])]
                clock = [sum(q * (rows[w, i] - rows[0, i]) for q, i in zip(weights, others, strict=True)) for w in own]
                time = np.array([-age_s[w] for w in own])
                value = np.array([rows[w, satellite] for w in own]) - np.array(clock)
                value -= value[0]  # polyfit is better conditioned without ambiguities
                if len(own) < 5:
                    continue
                line = np.polyfit(time[1:], value[1:], 1)
                found[receiver, band, satellite] = (
                    value[0] - line[1],  # the newest is at time zero
                    np.polyfit(time, value, 1)[0],
                    2.0 * np.polyfit(time, value, 2)[0],
                )
    return found
