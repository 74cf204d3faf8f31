"""decmesh on a desk: ways to bring a robot up, and to look at what it did."""

from deploy.decmesh.packages import insist_on_ours

insist_on_ours()
