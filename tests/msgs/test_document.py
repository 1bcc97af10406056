"""The page of the contract is that of the tables."""

from __future__ import annotations

from pathlib import Path

from gbas_msgs_py.document import contract_text

PAGE = Path(__file__).resolve().parents[2] / "docs" / "contract.md"


def test_the_page_is_made_of_the_present_tables() -> None:
    assert PAGE.read_text(encoding="utf-8") == contract_text(), "python -m gbas_msgs_py.document > docs/contract.md"
