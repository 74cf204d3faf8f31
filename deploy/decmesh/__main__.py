"""The command `decmesh`: looks whose packages it would run, and runs ours."""

from typing import NoReturn

from .packages import insist_on_ours  # Relative: in a checkout this package has a longer name.


def main() -> NoReturn:
    """Run the command line."""
    insist_on_ours()
    from deploy.__main__ import run  # noqa: PLC0415 - whose it is had to be known first

    run()


if __name__ == "__main__":
    main()
