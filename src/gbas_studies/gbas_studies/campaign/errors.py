"""What stops a campaign."""

from __future__ import annotations

from gbas_core.errors import EXIT_INTERRUPTED, GbasError


class CampaignError(GbasError):
    """A file of results, a scheduler or a worker that cannot be used."""


class CampaignInterrupted(GbasError):
    """A campaign stopped by a person; what is done is in its file."""

    exit_code = EXIT_INTERRUPTED
