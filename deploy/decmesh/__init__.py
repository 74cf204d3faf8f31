"""decmesh under its own name: what an installation offers as `decmesh`.

The four packages behind it have names that other projects use too, `protocol` and `deploy` on PyPI
among them. So the command begins here, and looks whose packages stand under those names.
"""
