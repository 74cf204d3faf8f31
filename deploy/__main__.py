"""`python -m deploy ...` is `decmesh ...`."""

import sys

from protocol.process.exit_codes import ExitCode

try:
    from deploy.cli import main
except ModuleNotFoundError as error:
    print(f"{error.name} is not installed; make run installs what decmesh needs", file=sys.stderr)
    sys.exit(ExitCode.UNFIT)

if __name__ == "__main__":
    main()
