"""`python -m deploy ...` is `decmesh ...`."""

from deploy.cli import main

if __name__ == "__main__":
    main()
