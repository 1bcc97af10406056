"""The 0.5 s frame: which message blocks go into which slots."""

from __future__ import annotations
