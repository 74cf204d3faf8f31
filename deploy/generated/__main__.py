"""Name the documents whose regions are out of date; with `--write`, make them anew."""

import argparse
import sys

from deploy.generated.regions import ROOT, documents, renewed


def main() -> int:
    """Check or rewrite every document; exit code 1: some are out of date."""
    parser = argparse.ArgumentParser(prog="python -m deploy.generated", description=__doc__)
    parser.add_argument("--write", action="store_true", help="Rewrite them.")
    write: bool = parser.parse_args().write
    stale = 0
    for path in documents():
        text = path.read_text(encoding="utf-8")
        new = renewed(text)
        if new == text:
            continue
        stale += 1
        if write:
            path.write_text(new, encoding="utf-8")
        print(f"{path.relative_to(ROOT)}: {'rewritten' if write else 'out of date; make docs'}")
    return 1 if stale and not write else 0


if __name__ == "__main__":
    sys.exit(main())
