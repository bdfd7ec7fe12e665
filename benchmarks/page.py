"""Tables of benchmarks in the pages of the docs: each stands between `<!-- name -->` and `<!-- end -->`."""

import argparse
import re
from collections.abc import Iterable
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def table(head: list[str], rows: list[list[object]]) -> str:
    """A markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(map(str, row)) + " |" for row in rows)])


def write(page: str, tables: dict[str, str]) -> None:
    """Put each table between its markers in a page."""
    path = DOCS / page
    text = path.read_text(encoding="utf-8")
    for name, new in tables.items():
        pattern = rf"(<!-- {re.escape(name)} -->\n).*?(<!-- end -->)"
        text, count = re.subn(pattern, lambda found, new=new: f"{found[1]}{new}\n{found[2]}", text, flags=re.DOTALL)
        if count != 1:
            raise SystemExit(f"{path} has {count} places for the table {name}; one is expected.")
    path.write_text(text, encoding="utf-8")


def tell(page: str, name: str, head: list[str], rows: Iterable[list[object]]) -> None:
    """Print rows as they come, then the table; with `--docs` on the command line put it into its page."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--docs", action="store_true", help=f"write the table into docs/{page}")
    docs, made = parser.parse_args().docs, []
    for row in rows:
        made.append(row)
        print(row, flush=True)
    text = table(head, made)
    print(text)
    if docs:
        write(page, {name: text})
