"""`python -m deploy ...` is `decmesh ...`."""

import sys
from typing import NoReturn

from protocol.process.exit_codes import ExitCode


def run() -> NoReturn:
    """Run the command line, or say which library is missing."""
    try:
        from deploy.cli import main  # noqa: PLC0415 - a library that is missing is a line

        main()  # Some libraries are needed by one command alone, and loaded by it.
    except ModuleNotFoundError as error:
        what = f"{error.name} is not installed; make run installs what decmesh needs"
        print(what, file=sys.stderr)
        sys.exit(ExitCode.UNFIT)


if __name__ == "__main__":
    run()
